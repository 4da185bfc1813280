"""People: bodies that move, their poses, and how they look. The bodies are MakeHuman's (CC0), built by
packaging/people/build.py into assets/people/data."""

from embodied.assets.people.bodies import PersonModel as Person
from embodied.assets.people.bodies import ground, joint_positions, people, posed, seated
from embodied.assets.people.pose import JOINTS, POSES, SITTING, STANDING, gaze
from embodied.assets.people.pose import BodyPose as Pose

__all__ = [
    "JOINTS", "POSES", "SITTING", "STANDING", "Person", "Pose", "gaze", "ground", "joint_positions", "people", "posed",
    "seated",
]  # fmt: skip
