#include "compute/hash_grid.h"

#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

// The eight corners around a sample in one level: their table entries and the interpolation weights per axis.
struct Cell {
  size_t entry[8];
  double side[3][2];

  double weight(int corner) const { return side[0][corner & 1] * side[1][corner >> 1 & 1] * side[2][corner >> 2 & 1]; }
  // ∂weight/∂w_axis
  double slope(int corner, int axis) const {
    double product = (corner >> axis & 1) ? 1 : -1;
    for (int other = 0; other < 3; ++other)
      if (other != axis) product *= side[other][corner >> other & 1];
    return product;
  }
};

Cell cellAround(const HashGridLevel& level, const double* x) {
  Cell cell;
  uint32_t lattice[3];
  for (int a = 0; a < 3; ++a) {
    const double position = level.scale * x[a] + 0.5;
    const double floor = std::floor(position);
    lattice[a] = static_cast<uint32_t>(static_cast<int64_t>(floor));
    cell.side[a][1] = position - floor;
    cell.side[a][0] = 1 - cell.side[a][1];
  }
  for (uint32_t corner = 0; corner < 8; ++corner)
    cell.entry[corner] =
        level.firstEntry +
        hashGridIndex(level, lattice[0] + (corner & 1), lattice[1] + (corner >> 1 & 1), lattice[2] + (corner >> 2 & 1));
  return cell;
}

}  // namespace

Doubles hashGridForward(const HashGrid& grid, View positions, View table) {
  const size_t samples = positions.size() / 3, features = grid.features;
  Doubles encoded(samples * grid.columns());
  for (size_t s = 0; s < samples; ++s)
    for (size_t l = 0; l < grid.levels.size(); ++l) {
      const Cell cell = cellAround(grid.levels[l], &positions[3 * s]);
      for (int corner = 0; corner < 8; ++corner)
        for (size_t f = 0; f < features; ++f)
          encoded[s * grid.columns() + l * features + f] +=
              cell.weight(corner) * table[cell.entry[corner] * features + f];
    }
  return encoded;
}

HashGridGradients hashGridBackward(const HashGrid& grid, View positions, View table, View encodedGradients) {
  const size_t samples = positions.size() / 3, features = grid.features;
  HashGridGradients gradients{Doubles(grid.parameters()), Doubles(samples * 3)};
  for (size_t s = 0; s < samples; ++s)
    for (size_t l = 0; l < grid.levels.size(); ++l) {
      const Cell cell = cellAround(grid.levels[l], &positions[3 * s]);
      for (int corner = 0; corner < 8; ++corner)
        for (size_t f = 0; f < features; ++f) {
          const double g = encodedGradients[s * grid.columns() + l * features + f];
          const size_t parameter = cell.entry[corner] * features + f;
          gradients.table[parameter] += cell.weight(corner) * g;
          if (table.empty()) continue;
          for (int a = 0; a < 3; ++a)
            gradients.positions[3 * s + a] += g * grid.levels[l].scale * cell.slope(corner, a) * table[parameter];
        }
    }
  return gradients;
}

void run(const HashGridForward& a) {
  const HostRows rows = hostRows(a.samples);
  CHECK(a.encoded.columns == a.grid.columns());
  store(a.encoded.rowsFrom(rows.begin),
        hashGridForward(a.grid, doublesOfRows(a.positions, 3, rows), doubles(a.table, a.grid.parameters())));
}

void run(const HashGridBackward& a) {
  const HostRows rows = hostRows(a.samples);
  const Doubles table = a.positionGradients ? doubles(a.table, a.grid.parameters()) : Doubles();
  const HashGridGradients gradients = hashGridBackward(a.grid, doublesOfRows(a.positions, 3, rows), table,
                                                       doubles(a.encodedGradients.rowsFrom(rows.begin), rows.count()));
  if (a.tableGradients) add(a.tableGradients, gradients.table);
  storeRows(a.positionGradients, 3, rows, gradients.positions);
}

}  // namespace tessera::reference
