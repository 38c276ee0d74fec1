#include "representations/mesh/content/mesh_encoder.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/check.h"
#include "representations/mesh/content/mesh_content.h"
#include "tiles/content_file.h"
#include "tiles/json_fields.h"
#include "tiles/writer_limits.h"

namespace tessera {
namespace {

using namespace json_fields;
using Broken = std::optional<std::string>;

constexpr int kMaxColumns = 128, kMaxHiddenLayers = 16, kMaxLog2TableSize = 28, kMaxResolution = 1 << 20;
constexpr float kLargestHalf = 65504, kLargestOffset = 1e6f;

bool areFiniteHalves(const std::vector<uint16_t>& halves) {
  constexpr uint16_t kExponent = 0x7c00;
  return std::none_of(halves.begin(), halves.end(), [](uint16_t half) { return (half & kExponent) == kExponent; });
}

uint64_t tableBytes(const MeshEncoder& encoder) {
  return sizeof(uint16_t) * HashGrid(encoder.grid).parameters();
}

// The rules about everything but the numbers of the table and the network.
Broken ruleOfSizes(const MeshEncoder& encoder) {
  const HashGridOptions& grid = encoder.grid;
  const bool hasFeatures = grid.features == 1 || grid.features == 2 || grid.features == 4 || grid.features == 8;
  if (!hasFeatures || grid.levels < 1 || grid.levels > kMaxColumns / grid.features)
    return "the levels or features of its hash grid are out of bounds";
  if (grid.log2TableSize < 3 || grid.log2TableSize > kMaxLog2TableSize) return "its log2_table_size is out of bounds";
  if (grid.baseResolution < 2 || grid.finestResolution < grid.baseResolution || grid.finestResolution > kMaxResolution)
    return "the resolutions of its hash grid are out of bounds";
  if (tableBytes(encoder) > kMaxTableBytes) return "its table is too large";
  if ((encoder.width != 16 && encoder.width != 32 && encoder.width != 64 && encoder.width != 128) ||
      encoder.hiddenLayers < 1 || encoder.hiddenLayers > kMaxHiddenLayers)
    return "the width or hidden_layers of its network are out of bounds";
  if (!(std::abs(encoder.opacityOffset) <= kLargestOffset)) return "its opacity_offset is out of bounds";
  return std::nullopt;
}

// Copies the view, which must have exactly this many numbers.
bool readHalves(const ContentFile& file, const json* reference, size_t count, std::vector<uint16_t>& halves) {
  const auto bytes = reference ? file.bufferViewBytes(*reference, kRawBytes) : std::nullopt;
  if (!bytes || bytes->size() / sizeof(uint16_t) != count || bytes->size() % sizeof(uint16_t) != 0) return false;
  halves.resize(count);
  std::memcpy(halves.data(), bytes->data(), bytes->size());
  return true;
}

}  // namespace

uint16_t toHalf(float value) {
  return Eigen::numext::bit_cast<uint16_t>(Eigen::half(std::clamp(value, -kLargestHalf, kLargestHalf)));
}

float fromHalf(uint16_t half) {
  return static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(half));
}

MlpShape MeshEncoder::shape() const {
  MlpShape shape;
  shape.inputs = grid.levels * grid.features;
  shape.width = static_cast<int>(width);
  shape.hiddenLayers = static_cast<int>(hiddenLayers);
  shape.outputs = static_cast<int>(kMeshFeatures);
  return shape;
}

uint64_t SharedEncoder::memoryBytes() const {
  return sizeof(SharedEncoder) + sizeof(uint16_t) * (encoder.table.size() + encoder.weights.size());
}

std::optional<std::string> validationError(const MeshEncoder& encoder) {
  if (Broken broken = ruleOfSizes(encoder)) return broken;
  if (encoder.table.size() != HashGrid(encoder.grid).parameters()) return "its table has the wrong size";
  if (encoder.weights.size() != countMultiplyAccumulates(encoder.shape())) return "its weights have the wrong size";
  if (!areFiniteHalves(encoder.table) || !areFiniteHalves(encoder.weights))
    return "it contains a number that is not finite";
  return std::nullopt;
}

Bytes encodeMeshEncoder(const MeshEncoder& encoder) {
  if (tableBytes(encoder) > kMaxTableBytes)
    throw contentTooLarge("the encoder of a block is too large", "train with a lower --set grid_log2_size");
  CHECK(validationError(encoder).value_or("") == "");
  ContentFileWriter file;
  nlohmann::ordered_json ours;
  ours["encoder"] = {{"levels", encoder.grid.levels},
                     {"features", encoder.grid.features},
                     {"log2_table_size", encoder.grid.log2TableSize},
                     {"base_resolution", encoder.grid.baseResolution},
                     {"finest_resolution", encoder.grid.finestResolution},
                     {"table", file.add(std::as_bytes(std::span(encoder.table)), kRawBytes)},
                     {"width", encoder.width},
                     {"hidden_layers", encoder.hiddenLayers},
                     {"weights", file.add(std::as_bytes(std::span(encoder.weights)), kRawBytes)},
                     {"opacity_offset", encoder.opacityOffset}};
  return file.finish(kMeshName, ours);
}

std::optional<MeshEncoder> decodeMeshEncoder(std::span<const std::byte> bytes, std::string& reason,
                                             const ContentLimits& limits) {
  reason.clear();
  const auto fail = [&reason](std::string why) {
    reason = std::move(why);
    return std::nullopt;
  };
  const auto file = decodeContentFile(bytes, kMeshName, reason);
  if (!file) return std::nullopt;
  const json* ours = getField(file->ours, "encoder");
  if (!ours) return fail("is not an encoder");
  MeshEncoder encoder;
  // What is missing or malformed becomes 0, which is out of bounds.
  const auto number = [&](const char* key) {
    return static_cast<int>(getUnsigned(*ours, key, kMaxResolution).value_or(0));
  };
  encoder.grid = {number("levels"), number("features"), number("log2_table_size"), number("base_resolution"),
                  number("finest_resolution")};
  encoder.width = static_cast<uint32_t>(number("width"));
  encoder.hiddenLayers = static_cast<uint32_t>(number("hidden_layers"));
  encoder.opacityOffset = static_cast<float>(getNumber(*ours, "opacity_offset").value_or(INFINITY));
  if (const Broken broken = ruleOfSizes(encoder)) return fail(*broken);
  if (tableBytes(encoder) > limits.bytes) return fail("its table is too large");
  if (!readHalves(*file, getField(*ours, "table"), tableBytes(encoder) / sizeof(uint16_t), encoder.table))
    return fail("its table is missing or has the wrong size");
  if (!readHalves(*file, getField(*ours, "weights"), countMultiplyAccumulates(encoder.shape()), encoder.weights))
    return fail("its weights are missing or have the wrong size");
  if (auto broken = validationError(encoder)) return fail(*broken);
  return encoder;
}

}  // namespace tessera
