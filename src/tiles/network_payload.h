// A network in a content's file (docs/tile-format.md, sections 6 and 7): its layers in the extension, its numbers in a
// buffer view. For codecs, not for their users: it shows JSON. What is read is untrusted: false, and why in `reason`
// (for people; the first reason counts), where it is refused.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tiles/content_file.h"
#include "tiles/dense_layer.h"

namespace tessera {

// Adds the numbers to the file → {"layers": [[inputs, outputs], ...], "bufferView": ..., "mimeType": ...}.
nlohmann::ordered_json writeNetwork(ContentFileWriter& file, const std::vector<DenseLayer>& network);

// The layers without their numbers, which `description` (what writeNetwork gave; null where there is none) promises.
bool readLayers(const nlohmann::json* description, std::vector<DenseLayer>& network, std::string& reason);
// Then the numbers, which must be just those that the layers need.
bool readLayerNumbers(const ContentFile& file, const nlohmann::json& description, std::vector<DenseLayer>& network,
                      std::string& reason);

// inputs → … → outputs, finite, and no larger than shaders take; what is broken, for people, and nothing where it
// holds.
std::optional<std::string> ruleOfNetwork(const std::vector<DenseLayer>& network, uint32_t inputs, uint32_t outputs);

}  // namespace tessera
