"""The public names of terrainkit. A module in this list is public with all its names."""

from terrainkit.curriculum import update_levels as update_levels
from terrainkit.curriculum.waypoints import Waypoints as Waypoints
from terrainkit.errors import TerrainkitError as TerrainkitError
from terrainkit.errors import TerrainkitWarning as TerrainkitWarning
from terrainkit.export import export_files as export_files
from terrainkit.features.building_codes import check_flight as check_flight
from terrainkit.features.flight import Flight as Flight
from terrainkit.geometry.solids import Solids as Solids
from terrainkit.geometry.solids import make_boxes as make_boxes
from terrainkit.geometry.solids import make_cylinders as make_cylinders
from terrainkit.geometry.solids import make_hulls as make_hulls
from terrainkit.importing.maps.import_curriculum import import_curriculum as import_curriculum
from terrainkit.importing.maps.import_map import ImportedMap as ImportedMap
from terrainkit.importing.maps.import_map import import_map as import_map
from terrainkit.importing.maps.terrain_mesh import import_terrain_mesh as import_terrain_mesh
from terrainkit.importing.readers.import_options import ImportOptions as ImportOptions
from terrainkit.map.generation import generate as generate
from terrainkit.map.import_report import ImportReport as ImportReport
from terrainkit.map.map_config import MapConfig as MapConfig
from terrainkit.map.patch import Patch as Patch
from terrainkit.map.patch import PatchParameters as PatchParameters
from terrainkit.map.patch import make_patch as make_patch
from terrainkit.map.terrain_map import TerrainMap as TerrainMap
from terrainkit.map.terrain_stream import TerrainStream as TerrainStream
from terrainkit.suites import Suite as Suite
from terrainkit.suites import generate_suite as generate_suite
from terrainkit.suites import get_suite as get_suite
from terrainkit.suites import suite_hash as suite_hash
from terrainkit.suites import suite_names as suite_names
from terrainkit.terrain import Terrain as Terrain
from terrainkit.terrain import parameter as parameter
from terrainkit.terrain.overlay import Overlay as Overlay
from terrainkit.terrain.registry import register_overlay as register_overlay
from terrainkit.terrain.registry import register_terrain as register_terrain
from terrainkit.terrain.sub_terrain import SubTerrain as SubTerrain
from terrainkit.terrain.worker_pool import worker_pool as worker_pool
from terrainkit.viewer.map_scene import show_map as show_map
from terrainkit.views.preview import write_preview as write_preview

from . import curriculum as curriculum
from . import feasibility as feasibility
from . import integrations as integrations
from . import perception as perception
from . import terrain as terrain

__version__: str
