"""People's words: requests, routes, sub-goals, and a listener who reads them."""

from embodied.language.clauses import RouteInstruction as RouteInstruction
from embodied.language.grammar import parse as parse
from embodied.language.listener import follow as follow
from embodied.language.people_language import Landmarks as Landmarks
from embodied.language.people_language import People as People
from embodied.language.people_language import RouteDescriber as RouteDescriber
from embodied.language.plain_language import PlainLanguage as PlainLanguage
