"""Message definitions: the text must describe exactly the installed type."""

from __future__ import annotations

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from robot_stack.contract.topics import TOPICS
from robot_stack.core.message_definitions import DefinitionMissing, message_definition, type_hash

TYPES = sorted({row.type for row in TOPICS})


@pytest.mark.parametrize("type_name", TYPES)
def test_the_text_describes_the_installed_type(type_name):
    """rosbags parses the text and computes the type's RIHS01 hash from it, independently of this code."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(message_definition(type_name), type_name))
    assert store.hash_rihs01(type_name) == type_hash(type_name)


@pytest.mark.parametrize("type_name", ["nowhere_msgs/msg/Nothing", "std_msgs/msg/Nothing"])
def test_a_type_that_is_not_installed(type_name):
    with pytest.raises(DefinitionMissing, match=type_name.split("/")[0]):
        message_definition(type_name)
    with pytest.raises(DefinitionMissing):
        type_hash(type_name)
