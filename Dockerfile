# docker build -t embodied .                                   houses, light, pictures, agents on the processor
# docker build -t embodied --build-arg BASE=nvidia/cuda:12.6.3-runtime-ubuntu24.04 .        the same on an NVIDIA GPU
# docker run --rm -v "$PWD/out:/out" embodied demo --small --out /out
# Run in a Debian 12 root, step by step. Not run yet: on the CUDA base.
ARG BASE=debian:bookworm-slim
FROM ${BASE}
ENV DEBIAN_FRONTEND=noninteractive NVIDIA_DRIVER_CAPABILITIES=all EMBODIED_CACHE=/cache PATH=/venv/bin:$PATH
RUN apt-get update -qq \
 && apt-get install -y -qq --no-install-recommends python3 python3-venv ca-certificates \
    libegl1 libgl1-mesa-dri libopengl0 libatomic1 sweethome3d-furniture \
 && apt-get install -y -qq --no-install-recommends \
    "$(apt-cache pkgnames libllvm | grep -E '^libllvm(1[5-9]|20)(t64)?$' | sort -V | tail -n 1)" \
 && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN python3 -m venv /venv && pip install --no-cache-dir -c /src/constraints.txt "/src[all]" && mkdir -p /cache && chmod 777 /cache
ENTRYPOINT ["python", "-m", "embodied"]
CMD ["doctor"]
