// The display modes of `mesh` scenes.
import { kSharedModes, type ShownMode } from '../../draw/display-modes';

export const kMeshModes = [
  ...kSharedModes,
  { name: 'triangles', label: 'Triangles' }, // untextured (UE4-NeRF, figure 9)
  { name: 'alpha', label: 'Opacity of the nearest triangle' },
  { name: 'layers', label: 'Number of layers' },
] as const satisfies readonly ShownMode[];
