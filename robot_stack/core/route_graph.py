"""The route graph of a site beside its map, ``config/maps/<name>/graph.geojson``: lanes that long routes follow.

Lanes edited on the robot are a file of its own data, which is in force instead (``SiteFile``).
The file format of Nav2's route server: a GeoJSON FeatureCollection in the map frame, coordinates in m.
    node   Point; properties id, optionally frame (map), metadata, operations
    edge   LineString or MultiLineString; properties id, startid, endid, optionally cost, overridable, metadata,
           operations
An edge is a straight lane from its start to its end, whatever its coordinates, and is driven in this direction only.
Of metadata, abs_speed_limit (m/s) and speed_limit (a share of the cruise speed up to 1, percent above) are used;
operations are not carried out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robot_stack.core.config import ConfigError, read_json
from robot_stack.core.mission import Coordinate
from robot_stack.core.site_files import SiteFile, site_file
from robot_stack.core.zones import SLOWEST_MPS

GRAPH_FILE = "graph.geojson"
Id = Annotated[int, Field(strict=True, ge=0, le=2**63 - 1)]


class _Part(BaseModel):
    # Other members belong to Nav2's plugins and to editors.
    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class _Metadata(_Part):
    abs_speed_limit: Annotated[float, Field(ge=SLOWEST_MPS, le=10.0)] | None = None
    speed_limit: Annotated[float, Field(gt=0.0, le=100.0)] | None = None


class _NodeProperties(_Part):
    id: Id
    frame: Literal["map"] = "map"


class _EdgeProperties(_Part):
    id: Id
    startid: Id
    endid: Id
    cost: Annotated[float, Field(ge=0.0)] = 0.0
    overridable: bool = True
    metadata: _Metadata = _Metadata()


class _Point(_Part):
    type: Literal["Point"]
    coordinates: Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]


class _Line(_Part):
    type: Literal["LineString", "MultiLineString"]


class _Node(_Part):
    properties: _NodeProperties
    geometry: _Point


class _Edge(_Part):
    properties: _EdgeProperties
    geometry: _Line


@dataclass(frozen=True, slots=True)
class RouteGraph:
    """points: (n, 2) m, map, of the nodes. ends: (e, 2) indices of start and end node of the edges.

    edge_ids: (e,) as in the file. cost_m: (e,) of an edge whose cost is fixed, else NaN. speed_mps: (e,), infinite
    without a limit. speed_share: (e,) of the cruise speed, 1 without a limit.
    """

    points: npt.NDArray[np.float64]
    ends: npt.NDArray[np.int64]
    edge_ids: npt.NDArray[np.int64]
    cost_m: npt.NDArray[np.float64]
    speed_mps: npt.NDArray[np.float64]
    speed_share: npt.NDArray[np.float64]


def graph_files(map_name: str) -> SiteFile:
    """Where the graph of a map lies. Raises ConfigError if there is no such map."""
    return site_file(map_name, GRAPH_FILE)


def load_graph(map_name: str) -> RouteGraph | None:
    """The graph of a map that is in force, None without one. Raises ConfigError naming the feature and the key."""
    path = graph_files(map_name).existing
    return None if path is None else read_graph(path)


def read_graph(path: Path) -> RouteGraph | None:
    """Raises ConfigError."""
    return graph_of(read_json(path), str(path))


def graph_of(content: Any, source: str) -> RouteGraph | None:
    """The graph of a FeatureCollection, None of an empty one. Raises ConfigError that begins with ``source``."""
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(features, list):
        raise ConfigError(f"{source}: must be a GeoJSON FeatureCollection")
    nodes: list[_Node] = []
    edges: list[_Edge] = []
    for index, feature in enumerate(features):
        try:
            if _kind(feature) == "Point":
                nodes.append(_Node.model_validate(feature))
            else:
                edges.append(_Edge.model_validate(feature))
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, ("features", index, *first["loc"])))
            raise ConfigError(f"{source}: {where}: {first['msg']}") from None
    return _graph(source, nodes, edges) if features else None


def _kind(feature: Any) -> Any:
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    return geometry.get("type") if isinstance(geometry, dict) else None


def _graph(source: str, nodes: list[_Node], edges: list[_Edge]) -> RouteGraph:
    ids = [node.properties.id for node in nodes] + [edge.properties.id for edge in edges]
    if len(set(ids)) != len(ids):
        twice = sorted({item for item in ids if ids.count(item) > 1})
        raise ConfigError(f"{source}: id {twice[0]} is used more than once; nodes and edges share their ids")
    if not edges:
        raise ConfigError(f"{source}: has no edges")
    index = {node.properties.id: place for place, node in enumerate(nodes)}
    for edge in edges:
        p = edge.properties
        for end in (p.startid, p.endid):
            if end not in index:
                raise ConfigError(f"{source}: edge {p.id}: there is no node {end}")
        if nodes[index[p.startid]].geometry.coordinates == nodes[index[p.endid]].geometry.coordinates:
            raise ConfigError(f"{source}: edge {p.id}: start and end are the same place")
    properties = [edge.properties for edge in edges]
    return RouteGraph(
        points=np.array([node.geometry.coordinates for node in nodes], np.float64),
        ends=np.array([(index[p.startid], index[p.endid]) for p in properties], np.int64),
        edge_ids=np.array([p.id for p in properties], np.int64),
        cost_m=np.array([math.nan if p.overridable else p.cost for p in properties], np.float64),
        speed_mps=np.array([p.metadata.abs_speed_limit or math.inf for p in properties], np.float64),
        speed_share=np.array([_share(p.metadata.speed_limit) for p in properties], np.float64),
    )


def _share(limit: float | None) -> float:
    if limit is None:
        return 1.0
    return limit if limit <= 1.0 else limit / 100.0
