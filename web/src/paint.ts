// Drawing a cube of six faces: with WebGL, or pixel by pixel where a browser has none.
//
// The faces lie side by side in one picture, in the order of embodied.render.panorama.FACES: +x, +y, -x, -y, up, down.
// Directions are (x, z, y) of the world, in which the sides are oriented as WebGL wants them; up and down are turned.

export interface Painter {
  /** Takes the six faces. */
  take(image: HTMLImageElement): void;
  /** Draws the view along yaw and pitch; `wide` and `tall` are tangents of half the angles of view. */
  draw(yaw: number, pitch: number, wide: number, tall: number): void;
}

const SIDES = [0, 4, 1, 5, 2, 3]; // of WebGL's cube, for each face: +x, +z, -x, -z, +y, -y

const VERTEX = `#version 300 es
in vec2 at; out vec2 screen;
void main() { screen = at; gl_Position = vec4(at, 0.0, 1.0); }`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec2 screen; out vec4 colour;
uniform samplerCube cube; uniform mat3 turn; uniform vec2 half_view;
void main() { colour = vec4(texture(cube, turn * vec3(1.0, screen.y * half_view.y, -screen.x * half_view.x)).rgb, 1.0); }`;

/** Columns of the matrix that turns (ahead, up, left) into a direction. */
function turned(yaw: number, pitch: number): number[] {
  const [c, s, p, q] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return [c * p, q, s * p, -c * q, p, -s * q, -s, 0, c];
}

/** One face as WebGL wants it. */
function faceOf(image: HTMLImageElement, k: number): CanvasRenderingContext2D {
  const side = image.naturalHeight;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  if (k === 4) context.setTransform(0, -1, 1, 0, 0, side);
  if (k === 5) context.setTransform(0, 1, -1, 0, side, 0);
  context.drawImage(image, k * side, 0, side, side, 0, 0, side, side);
  return context;
}

/** What draws on `canvas`. */
export function painter(canvas: HTMLCanvasElement): Painter {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
  return gl ? withWebGL(canvas, gl) : byPixel(canvas);
}

function sized(canvas: HTMLCanvasElement, scale: number): boolean {
  const [w, t] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
  if (canvas.width !== w || canvas.height !== t) [canvas.width, canvas.height] = [w, t];
  return w > 0 && t > 0;
}

function withWebGL(canvas: HTMLCanvasElement, gl: WebGL2RenderingContext): Painter {
  let filled = false;
  let turn: WebGLUniformLocation | null, half: WebGLUniformLocation | null;
  let held: HTMLImageElement | null = null;
  const begin = (): void => {
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(gl.getAttribLocation(program, "at"));
    gl.vertexAttribPointer(gl.getAttribLocation(program, "at"), 2, gl.FLOAT, false, 0, 0);
    gl.bindTexture(gl.TEXTURE_CUBE_MAP, gl.createTexture());
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_CUBE_MAP, filter, gl.LINEAR);
    turn = gl.getUniformLocation(program, "turn");
    half = gl.getUniformLocation(program, "half_view");
  };
  const take = (image: HTMLImageElement): void => {
    held = image;
    SIDES.forEach((side, k) => {
      const target = gl.TEXTURE_CUBE_MAP_POSITIVE_X + side;
      gl.texImage2D(target, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, faceOf(image, k).canvas);
    });
    filled = true;
  };
  begin();
  canvas.addEventListener("webglcontextlost", (e) => e.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    begin();
    if (held) take(held);
  });
  return {
    take,
    draw(yaw, pitch, wide, tall) {
      if (!filled || !sized(canvas, Math.min(devicePixelRatio, 2))) return;
      gl.viewport(0, 0, canvas.width, canvas.height);
      gl.uniformMatrix3fv(turn, false, turned(yaw, pitch));
      gl.uniform2f(half, wide, tall);
      gl.drawArrays(gl.TRIANGLES, 0, 3);
    },
  };
}

function byPixel(canvas: HTMLCanvasElement): Painter {
  const context = canvas.getContext("2d")!;
  let sides: Uint32Array[] = [];
  let size = 0;
  return {
    take(image) {
      size = image.naturalHeight;
      sides = [];
      SIDES.forEach((side, k) => {
        sides[side] = new Uint32Array(faceOf(image, k).getImageData(0, 0, size, size).data.buffer);
      });
    },
    draw(yaw, pitch, wide, tall) {
      if (!size || !sized(canvas, Math.min(1, 640 / Math.max(canvas.clientWidth, canvas.clientHeight, 1)))) return;
      const [w, t] = [canvas.width, canvas.height];
      const picture = context.createImageData(w, t);
      const out = new Uint32Array(picture.data.buffer);
      const m = turned(yaw, pitch) as [number, number, number, number, number, number, number, number, number];
      for (let j = 0; j < t; j++) {
        const up = (1 - (2 * j + 1) / t) * tall;
        for (let i = 0; i < w; i++) {
          const left = (1 - (2 * i + 1) / w) * wide;
          const x = m[0] + m[3] * up + m[6] * left;
          const y = m[1] + m[4] * up;
          const z = m[2] + m[5] * up + m[8] * left;
          const [ax, ay, az] = [Math.abs(x), Math.abs(y), Math.abs(z)];
          let side: number, u: number, v: number, along: number;
          if (ax >= ay && ax >= az) [side, u, v, along] = x > 0 ? [0, -z, -y, ax] : [1, z, -y, ax];
          else if (ay >= az) [side, u, v, along] = y > 0 ? [2, x, z, ay] : [3, x, -z, ay];
          else [side, u, v, along] = z > 0 ? [4, x, -y, az] : [5, -x, -y, az];
          const column = Math.min(size - 1, ((u / along + 1) * size) >> 1);
          const row = Math.min(size - 1, ((v / along + 1) * size) >> 1);
          out[j * w + i] = sides[side]![row * size + column]!;
        }
      }
      context.putImageData(picture, 0, 0);
    },
  };
}
