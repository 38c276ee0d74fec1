// How scenes of `mesh` are drawn.
import type { SceneDrawing } from '../../draw/scene-drawer';
import type { MeshHeader } from './decode-mesh';
import type { MeshContent } from './mesh-content';
import { MeshDrawer, type DrawnMesh } from './mesh-drawer';
import { kMeshModes } from './mesh-modes';

export const meshDrawing = {
  modes: kMeshModes,
  makeDrawer: (renderer, scene) => new MeshDrawer(renderer, scene),
} satisfies SceneDrawing<MeshHeader, MeshContent, DrawnMesh>;
