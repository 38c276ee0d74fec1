// A network in a content's file (docs/tile-format.md, sections 6 and 7): its layer sizes are in the extension, its
// weights and biases in a buffer view. This header exposes JSON; it is for codecs, not for their users. What is read is
// untrusted: functions return false if they refuse it and state why in `reason`, for people; an earlier reason is not
// overwritten.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tiles/content_file.h"
#include "tiles/dense_layer.h"

namespace tessera {

// Adds the weights and biases to the file. Returns {"layers": [[inputs, outputs], ...], "bufferView": ..., "mimeType":
// ...}.
nlohmann::ordered_json writeNetwork(ContentFileWriter& file, const std::vector<DenseLayer>& network);

// Reads the layer sizes, without weights, from `description` (what writeNetwork returned; null if it is missing).
bool readLayers(const nlohmann::json* description, std::vector<DenseLayer>& network, std::string& reason);
// Reads the weights and biases, of which there must be exactly as many as the layers need.
bool readLayerNumbers(const ContentFile& file, const nlohmann::json& description, std::vector<DenseLayer>& network,
                      std::string& reason);

// Checks that the layers chain from `inputs` to `outputs`, that all numbers are finite, and that the network is not
// larger than shaders support. Returns the violated rule, for people, or nothing if all hold.
std::optional<std::string> ruleOfNetwork(const std::vector<DenseLayer>& network, uint32_t inputs, uint32_t outputs);

}  // namespace tessera
