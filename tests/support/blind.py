"""Arguments of nodes that a test runs without a LiDAR and without a map."""

from __future__ import annotations

WITHOUT_MAP = ("-p", "map:=''")
BLIND = (*WITHOUT_MAP, "-p", "use_costmap:=false")
