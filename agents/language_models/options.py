"""Command-line options of the model that is asked."""

from __future__ import annotations

import argparse
from pathlib import Path

from agents.language_models.cache import AnswerCache
from agents.language_models.client import FORMS, Client, ServerSettings


def add_model(parser: argparse.ArgumentParser) -> argparse._ArgumentGroup:
    """--model and all that belongs to it, as a group; `client_of` reads them."""
    group = parser.add_argument_group("the language model")
    plain = ServerSettings("")
    group.add_argument("--model", metavar="NAME", help="name of the model, as its server knows it")
    group.add_argument(
        "--base-url", default=plain.base_url, metavar="URL", help="server of chat completions (default: %(default)s)"
    )
    group.add_argument(
        "--key-variable",
        default=plain.key_variable,
        metavar="NAME",
        help="environment variable with the key, where the server wants one (default: %(default)s)",
    )
    group.add_argument("--form", choices=FORMS, default=plain.form, help="how JSON is asked for (default: %(default)s)")
    group.add_argument("--temperature", type=float, default=0.0, help="sampling temperature (default: 0)")
    group.add_argument(
        "--most-tokens",
        type=int,
        default=plain.most_tokens,
        metavar="N",
        help="longest answer in tokens (default: %(default)s)",
    )
    group.add_argument("--price-in", type=float, default=0.0, metavar="X", help="price of a million tokens sent")
    group.add_argument("--price-out", type=float, default=0.0, metavar="X", help="price of a million tokens answered")
    group.add_argument(
        "--timeout",
        type=float,
        default=plain.timeout,
        metavar="S",
        help="seconds to wait for an answer (default: %(default)s)",
    )
    group.add_argument(
        "--tries",
        type=int,
        default=plain.tries,
        metavar="N",
        help="send a request at most N times (default: %(default)s)",
    )
    group.add_argument(
        "--together",
        type=int,
        default=plain.together,
        metavar="N",
        help="send at most N requests at a time (default: %(default)s)",
    )
    group.add_argument(
        "--answers",
        type=Path,
        default=Path("answers.sqlite"),
        metavar="FILE",
        help="file that keeps every answer: what was asked before is not asked again (default: %(default)s)",
    )
    group.add_argument("--offline", action="store_true", help="only answers that are kept are used")
    group.add_argument("--prompts", type=Path, metavar="DIR", help="folder with prompts of your own (agent.md, ...)")
    return group


def client_of(args: argparse.Namespace) -> Client:
    """The client that the options describe.

    Raises:
      ValueError: no model was named.
    """
    if not args.model:
        raise ValueError("a language model takes part: name it with --model NAME (and its server with --base-url URL)")
    settings = ServerSettings(
        model=args.model,
        base_url=args.base_url,
        key_variable=args.key_variable,
        form=args.form,
        temperature=args.temperature,
        most_tokens=args.most_tokens,
        price_in=args.price_in,
        price_out=args.price_out,
        timeout=args.timeout,
        tries=args.tries,
        together=args.together,
    )
    return Client(settings, AnswerCache(args.answers), offline=args.offline)
