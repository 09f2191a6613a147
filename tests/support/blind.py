"""Arguments of a navigation controller that a test runs without a LiDAR and without a map."""

from __future__ import annotations

BLIND = ("-p", "map:=''", "-p", "use_costmap:=false")
