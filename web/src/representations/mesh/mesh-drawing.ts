// How scenes of `mesh` are drawn.
import type { SceneDrawing } from '../../draw/scene-drawer';
import type { MeshHeader } from './decode-mesh';
import type { MeshContent } from './mesh-content';
import { MeshDrawer, type DrawnMesh } from './mesh-drawer';
import { kMeshModes } from './mesh-modes';

export const meshDrawing = {
  modes: kMeshModes,
  hysteresis: 1.5, // as UE4-NeRF's plugin frees a finer level beyond 1.5 times its distance
  makeDrawer: (renderer, scene) => new MeshDrawer(renderer, scene),
} satisfies SceneDrawing<MeshHeader, MeshContent, DrawnMesh>;
