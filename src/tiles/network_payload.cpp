#include "tiles/network_payload.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "tiles/json_fields.h"

namespace tessera {

using namespace json_fields;

namespace {

static_assert(std::endian::native == std::endian::little);

void append(Bytes& bytes, const std::vector<float>& numbers) {
  const auto raw = std::as_bytes(std::span(numbers));
  bytes.insert(bytes.end(), raw.begin(), raw.end());
}

bool takeFloats(std::span<const std::byte>& bytes, size_t count, std::vector<float>& numbers) {
  if (bytes.size() / sizeof(float) < count) return false;
  numbers.resize(count);
  std::memcpy(numbers.data(), bytes.data(), count * sizeof(float));
  bytes = bytes.subspan(count * sizeof(float));
  return true;
}

bool areFinite(const std::vector<float>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](float number) { return std::isfinite(number); });
}

bool refuse(std::string& reason, const char* why) {
  if (reason.empty()) reason = why;
  return false;
}

}  // namespace

nlohmann::ordered_json writeNetwork(ContentFileWriter& file, const std::vector<DenseLayer>& network) {
  Bytes bytes;
  nlohmann::ordered_json layers = nlohmann::ordered_json::array();
  for (const DenseLayer& layer : network) {
    layers.push_back({layer.inputs, layer.outputs});
    append(bytes, layer.weights);
    append(bytes, layer.biases);
  }
  nlohmann::ordered_json description = {{"layers", std::move(layers)}};
  description.update(file.add(bytes, kRawBytes));
  return description;
}

bool readLayers(const json* description, std::vector<DenseLayer>& network, std::string& reason) {
  const json* layers = description ? getArray(*description, "layers") : nullptr;
  if (!layers || layers->size() > kMaxLayers) return refuse(reason, "has no network");
  for (const json& sides : *layers) {
    if (!sides.is_array() || sides.size() != 2) return refuse(reason, "a layer of the network has no two sides");
    const auto inputs = unsignedFrom(sides[0], kMaxLayerWidth), outputs = unsignedFrom(sides[1], kMaxLayerWidth);
    if (!inputs || !outputs) return refuse(reason, "a layer of the network is out of bounds");
    DenseLayer layer;
    layer.inputs = static_cast<uint32_t>(*inputs);
    layer.outputs = static_cast<uint32_t>(*outputs);
    network.push_back(std::move(layer));
  }
  return true;
}

bool readLayerNumbers(const ContentFile& file, const json& description, std::vector<DenseLayer>& network,
                      std::string& reason) {
  auto bytes = file.bufferViewBytes(description, kRawBytes);
  if (!bytes) return refuse(reason, "has no network");
  for (DenseLayer& layer : network) {
    if (!takeFloats(*bytes, size_t{layer.inputs} * layer.outputs, layer.weights) ||
        !takeFloats(*bytes, layer.outputs, layer.biases)) {
      return refuse(reason, "the network has fewer numbers than its layers need");
    }
  }
  return bytes->empty() || refuse(reason, "the network has more numbers than its layers need");
}

std::optional<std::string> ruleOfNetwork(const std::vector<DenseLayer>& network, uint32_t inputs, uint32_t outputs) {
  if (network.empty() || network.size() > kMaxLayers) return "the network has no layers, or too many";
  uint32_t width = inputs, vectors = 0;
  for (const DenseLayer& layer : network) {
    if (layer.inputs != width || layer.outputs < 1 || layer.outputs > kMaxLayerWidth) {
      return "the network's layers do not follow one another";
    }
    width = layer.outputs;
    vectors += networkVectors(layer.inputs, layer.outputs);
    if (layer.weights.size() != size_t{layer.inputs} * layer.outputs || layer.biases.size() != layer.outputs) {
      return "a layer of the network has the wrong number of weights or biases";
    }
    if (!areFinite(layer.weights) || !areFinite(layer.biases))
      return "the network contains a number that is not finite";
  }
  if (width != outputs) return "the network does not end in a colour";
  if (vectors > kMaxNetworkVectors) return "the network is too large for a shader";
  return std::nullopt;
}

}  // namespace tessera
