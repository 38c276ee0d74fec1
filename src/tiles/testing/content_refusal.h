// For tests: what the tests of payloads of all representations share.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "base/image.h"
#include "tiles/content.h"
#include "tiles/glb.h"
#include "tiles/lossless_image.h"

namespace tessera::tiles_test {

// Fixture of tests that corrupt a file and check that decoding rejects it with the right reason.
class Refusal : public testing::Test {
 protected:
  using json = nlohmann::json;
  static json& ours(json& asset) { return asset["extensions"]["TESSERA_content"]; }
  static json& part(json& asset) { return ours(asset)["parts"][0]; }

  virtual Bytes file() const = 0;
  virtual bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const = 0;

  // Expects that decoding fails with a reason that begins with `why` after `spoil` has changed the JSON.
  void refuses(const std::string& why, const std::function<void(json&)>& spoil, const ContentLimits& limits = {}) {
    const auto spoilAsset = [&](json& asset, Bytes&) { spoil(asset); };
    refusesBytes(why, spoilAsset, limits);
  }
  void refusesBytes(const std::string& why, const std::function<void(json&, Bytes&)>& spoil,
                    const ContentLimits& limits = {}) {
    const Bytes whole = file();
    const auto view = decodeGlb(whole);
    json asset = json::parse(view->json);
    Bytes bytes(view->bytes.begin(), view->bytes.end());
    spoil(asset, bytes);
    std::string reason;
    EXPECT_FALSE(isRead(encodeGlb(asset.dump(), bytes), reason, limits)) << why;
    EXPECT_EQ(reason.substr(0, why.size()), why);
  }
  // Replaces the picture to which `entry` refers.
  static void replace(json& asset, Bytes& bytes, json& entry, const ImageU8& image) {
    const Bytes encoded = encodeLossless(image, 1);
    bytes.resize((bytes.size() + 3) / 4 * 4);
    asset["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", encoded.size()}});
    entry["bufferView"] = asset["bufferViews"].size() - 1;
    bytes.insert(bytes.end(), encoded.begin(), encoded.end());
    asset["buffers"][0]["byteLength"] = bytes.size();
  }
};

}  // namespace tessera::tiles_test
