// The display modes of `hash` scenes.
import { kSharedModes, type ShownMode } from '../../draw/display-modes';

// The last three modes show one feature level (NGP-RT, figures 6 and S2): its contribution to the colour, its attention
// weights for colours, and those for density. The coarse features have no weights.
export const kHashModes = [
  ...kSharedModes,
  { name: 'contribution', label: 'Colour of a hash level', featureLevel: 'any' },
  { name: 'attention', label: 'Attention to colour', featureLevel: 'fine' },
  { name: 'densityAttention', label: 'Attention to density', featureLevel: 'fine' },
] as const satisfies readonly ShownMode[];
