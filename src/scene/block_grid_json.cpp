#include "scene/block_grid_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace tessera {
namespace {

using nlohmann::json;

constexpr double kGridRotationTolerance = 1e-9;  // of RᵀR from the identity; our own are read back exactly
constexpr double kHeightTolerance = 1e-9;        // relative excess of the height over the edge

std::optional<double> numberIn(const json& object, const char* key) {
  const auto entry = object.find(key);
  if (entry == object.end() || !entry->is_number()) return std::nullopt;
  const double value = entry->get<double>();
  return std::abs(value) <= kFarthest ? std::optional(value) : std::nullopt;  // nothing for NaN
}

std::optional<int> countIn(const json& object, const char* key) {
  const auto entry = object.find(key);
  if (entry == object.end() || !entry->is_number_integer()) return std::nullopt;
  const auto value = numberIn(object, key);
  return value && *value >= 1 && *value <= kMaxAlong ? std::optional(static_cast<int>(*value)) : std::nullopt;
}

bool readNumbers(const json& object, const char* key, size_t count, double* out) {
  const auto entry = object.find(key);
  if (entry == object.end() || !entry->is_array() || entry->size() != count) return false;
  for (const json& number : *entry) {
    if (!number.is_number()) return false;
    *out = number.get<double>();
    if (!(std::abs(*out++) <= kFarthest)) return false;
  }
  return true;
}

}  // namespace

json blockGridToJson(const BlockGrid& grid) {
  json rotation = json::array();
  for (int i = 0; i < 9; ++i) rotation.push_back(grid.gridFromWorld(i / 3, i % 3));
  const Vec3d& origin = grid.originInWorld;
  return {{"origin", {origin.x(), origin.y(), origin.z()}},
          {"grid_from_world", rotation},
          {"edge", grid.edge},
          {"columns", grid.columns},
          {"rows", grid.rows},
          {"bottom", grid.bottom},
          {"top", grid.top}};
}

std::optional<BlockGrid> blockGridFromJson(const json& value) {
  if (!value.is_object()) return std::nullopt;
  BlockGrid grid;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation;
  if (!readNumbers(value, "origin", 3, grid.originInWorld.data())) return std::nullopt;
  if (!readNumbers(value, "grid_from_world", 9, rotation.data())) return std::nullopt;
  if ((rotation.transpose() * rotation - Mat3d::Identity()).cwiseAbs().maxCoeff() > kGridRotationTolerance ||
      rotation.determinant() < 0) {
    return std::nullopt;
  }
  grid.gridFromWorld = rotation;
  const auto edge = numberIn(value, "edge"), bottom = numberIn(value, "bottom"), top = numberIn(value, "top");
  const auto columns = countIn(value, "columns"), rows = countIn(value, "rows");
  if (!edge || !bottom || !top || !columns || !rows) return std::nullopt;
  if (!(*edge > 0) || !(*bottom < *top) || *top - *bottom > *edge * (1 + kHeightTolerance)) return std::nullopt;
  if (*columns > kMaxBlocks / *rows) return std::nullopt;
  grid.edge = *edge;
  grid.columns = *columns;
  grid.rows = *rows;
  grid.bottom = *bottom;
  grid.top = *top;
  return grid;
}

}  // namespace tessera
