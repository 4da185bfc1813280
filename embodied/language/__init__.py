"""What people say: requests, routes, sub-goals, and a listener who reads them."""

from embodied.language.clauses import RouteInstruction as RouteInstruction
from embodied.language.grammar import parse as parse
from embodied.language.listener import follow as follow
from embodied.language.plain import PlainLanguage as PlainLanguage
from embodied.language.voice import People as People
from embodied.language.voice import RouteDescriber as RouteDescriber
