#include "tiles/network_payload.h"

#include <gtest/gtest.h>

#include <limits>

namespace tessera {
namespace {

using nlohmann::json;

// A network 3 → 2 → 1 whose numbers all differ.
std::vector<DenseLayer> testNetwork() {
  return {{3, 2, {1, 2, 3, 4, 5, 6}, {7, 8}}, {2, 1, {9, 10}, {11.5f}}};
}

// Encodes the file that a codec "made" writes for a network, with a description that `change` alters.
template <class Change>
Bytes encodeNetworkFile(const std::vector<DenseLayer>& network, const Change& change) {
  ContentFileWriter writer;
  nlohmann::ordered_json description = writeNetwork(writer, network);
  change(description);
  return writer.finish("made", {{"network", description}});
}

// Returns why a network is refused; empty if it is accepted, and `read` then receives it.
template <class Change>
std::string decodeErrorReason(const Change& change, std::vector<DenseLayer>& read) {
  const Bytes bytes = encodeNetworkFile(testNetwork(), change);
  std::string reason;
  const auto file = decodeContentFile(bytes, "made", reason);
  EXPECT_TRUE(file.has_value()) << reason;
  if (!file) return reason;
  const json& description = file->ours.at("network");
  const bool isRead = readLayers(&description, read, reason) && readLayerNumbers(*file, description, read, reason);
  EXPECT_EQ(isRead, reason.empty());
  return reason;
}

template <class Change>
std::string decodeErrorReason(const Change& change) {
  std::vector<DenseLayer> read;
  return decodeErrorReason(change, read);
}

TEST(NetworkPayload, ReadsWhatWasWritten) {
  std::vector<DenseLayer> read;
  EXPECT_EQ(decodeErrorReason([](auto&) {}, read), "");
  EXPECT_EQ(read, testNetwork());
}

TEST(NetworkPayload, RejectsInvalidLayers) {
  EXPECT_EQ(decodeErrorReason([](auto& network) { network["layers"] = 3; }), "has no network");
  EXPECT_EQ(decodeErrorReason([](auto& network) {
              network["layers"] = std::vector<std::array<int, 2>>(9, {1, 1});
            }),
            "has no network");
  EXPECT_EQ(decodeErrorReason([](auto& network) { network["layers"][0] = {3}; }),
            "a layer of the network has no two sides");
  EXPECT_EQ(decodeErrorReason([](auto& network) {
              network["layers"][0] = {3, 1 << 30};
            }),
            "a layer of the network is out of bounds");
  EXPECT_EQ(decodeErrorReason([](auto& network) {
              network["layers"][0] = {-3, 2};
            }),
            "a layer of the network is out of bounds");
  std::vector<DenseLayer> read;
  std::string reason;
  EXPECT_FALSE(readLayers(nullptr, read, reason));
  EXPECT_EQ(reason, "has no network");
}

TEST(NetworkPayload, RejectsNumbersThatDoNotMatchItsLayers) {
  EXPECT_EQ(decodeErrorReason([](auto& network) {
              network["layers"][1] = {2, 2};
            }),
            "the network has fewer numbers than its layers need");
  EXPECT_EQ(decodeErrorReason([](auto& network) {
              network["layers"][0] = {2, 2};
            }),
            "the network has more numbers than its layers need");
  EXPECT_EQ(decodeErrorReason([](auto& network) { network["bufferView"] = 1; }), "has no network");
  EXPECT_EQ(decodeErrorReason([](auto& network) { network["mimeType"] = "image/webp"; }), "has no network");
}

TEST(NetworkPayload, KeepsTheFirstReason) {
  std::vector<DenseLayer> read;
  std::string reason = "was refused already";
  EXPECT_FALSE(readLayers(nullptr, read, reason));
  EXPECT_EQ(reason, "was refused already");
}

TEST(NetworkRule, NamesWhatIsBroken) {
  const auto broken = [](auto change, uint32_t inputs = 3, uint32_t outputs = 1) {
    std::vector<DenseLayer> network = testNetwork();
    change(network);
    return ruleOfNetwork(network, inputs, outputs).value_or("");
  };
  using Network = std::vector<DenseLayer>;
  EXPECT_EQ(broken([](Network&) {}), "");
  EXPECT_EQ(broken([](Network& network) { network.clear(); }), "the network has no layers, or too many");
  EXPECT_EQ(broken([](Network& network) { network.resize(9); }), "the network has no layers, or too many");
  EXPECT_EQ(broken([](Network&) {}, 4), "the network's layers do not follow one another");
  EXPECT_EQ(broken([](Network& network) { network[1].inputs = 3; }), "the network's layers do not follow one another");
  EXPECT_EQ(broken([](Network& network) { network[1].weights.pop_back(); }),
            "a layer of the network has the wrong number of weights or biases");
  EXPECT_EQ(broken([](Network& network) { network[0].biases.push_back(0); }),
            "a layer of the network has the wrong number of weights or biases");
  EXPECT_EQ(broken([](Network& network) { network[1].biases[0] = std::numeric_limits<float>::infinity(); }),
            "the network contains a number that is not finite");
  EXPECT_EQ(broken([](Network& network) { network[0].weights[5] = std::numeric_limits<float>::quiet_NaN(); }),
            "the network contains a number that is not finite");
  EXPECT_EQ(broken([](Network&) {}, 3, 2), "the network does not end in a colour");
}

TEST(NetworkRule, AllowsNoMoreThanShadersTake) {
  const auto wide = [](uint32_t inputs) {
    const DenseLayer layer = {inputs, 256, std::vector<float>(size_t{inputs} * 256), std::vector<float>(256)};
    return ruleOfNetwork({layer}, inputs, 256).value_or("");
  };
  EXPECT_EQ(wide(63), "");  // 64 groups of four outputs, each with biases and 63 weights: 4096 vectors
  EXPECT_EQ(wide(64), "the network is too large for a shader");
}

}  // namespace
}  // namespace tessera
