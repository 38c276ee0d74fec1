// What of a `hash` scene can be shown.
import { kSharedModes, type ShownMode } from '../../draw/display-modes';

// The last three show one of the levels of features (NGP-RT, figures 6 and S2): what it alone gives to the colour, and what it
// is weighed with, for colours and for density. Nothing weighs the coarse features.
export const kHashModes = [
  ...kSharedModes,
  { name: 'contribution', label: 'Colour of a hash level', featureLevel: 'any' },
  { name: 'attention', label: 'Attention to colour', featureLevel: 'fine' },
  { name: 'densityAttention', label: 'Attention to density', featureLevel: 'fine' },
] as const satisfies readonly ShownMode[];
