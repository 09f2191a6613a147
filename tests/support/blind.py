"""Arguments for a navigation controller under test without a LiDAR and without a map."""

from __future__ import annotations

BLIND = ("-p", "map:=''", "-p", "use_costmap:=false")
