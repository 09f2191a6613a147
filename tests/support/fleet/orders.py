"""Orders of VDA 5050 2.1 as a file has them."""

from __future__ import annotations

import itertools
from typing import Any


def order(
    order_id: str, nodes: list[str], *, update: int = 0, released: int | None = None, **header: Any
) -> dict[str, Any]:
    """A straight route over ``nodes`` of the map ``yard``, 1 m apart. released: number of nodes, by default all.

    header: e.g. serialNumber.
    """
    base = len(nodes) if released is None else released
    return {
        **header,
        "orderId": order_id,
        "orderUpdateId": update,
        "nodes": [
            {
                "nodeId": node,
                "sequenceId": 2 * index,
                "released": index < base,
                "nodePosition": {"x": 1.0 + index, "y": 2.0, "mapId": "yard"},
                "actions": [],
            }
            for index, node in enumerate(nodes)
        ],
        "edges": [
            {
                "edgeId": f"{start}-{end}",
                "sequenceId": 2 * index + 1,
                "released": index + 1 < base,
                "startNodeId": start,
                "endNodeId": end,
                "actions": [],
            }
            for index, (start, end) in enumerate(itertools.pairwise(nodes))
        ],
    }
