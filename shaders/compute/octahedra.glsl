// The faces of octahedra grids, as in src/compute/octahedra.h.
// Defines: kFacesPerCell, faceCorner().

const uint kFacesPerCell = 20, kOuterFaces = 8;

// The cell of a vertex of a face, relative to the cell of the octahedron.
ivec3 faceCorner(uint local, uint corner) {
  ivec3 cell = ivec3(0);
  if (local < kOuterFaces) {
    cell[corner] = (local >> corner & 1) != 0 ? -1 : 1;
    return cell;
  }
  const uint pair = (local - kOuterFaces) / 4, signs = (local - kOuterFaces) % 4;
  if (corner == 1) cell[pair == 2 ? 1 : 0] = (signs & 2) != 0 ? -1 : 1;
  if (corner == 2) cell[pair == 0 ? 1 : 2] = (signs & 1) != 0 ? -1 : 1;
  return cell;
}
