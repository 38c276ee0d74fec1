// What a tile holds, whatever its representation: decoded contents, what several of them share, and the codec that
// makes them of untrusted bytes. A representation has one codec; everything that reads scenes knows no more of it than
// this.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/check.h"

namespace tessera {

struct SharedResource;  // tiles/tileset.h
struct TileContent;

// What readers allow.
struct ContentLimits {
  uint64_t fileBytes = uint64_t{1} << 30;
  uint64_t bytes = uint64_t{1} << 30;  // of the content in memory; decoding takes up to two thirds more for a moment
  uint32_t parts = 1024;
};

// What several contents of a scene need and what is in memory once for all of them: a network, a table of a block.
class Resource {
 public:
  Resource() = default;
  Resource(const Resource&) = delete;
  Resource& operator=(const Resource&) = delete;
  virtual ~Resource() = default;

  virtual uint64_t memoryBytes() const = 0;
};
// Those of a content, in the order of TileContent::resources. A content that needs them longer keeps them.
using Resources = std::vector<std::shared_ptr<const Resource>>;

// A decoded content, which keeps all rules of its format.
class Content {
 public:
  Content() = default;
  Content(const Content&) = delete;
  Content& operator=(const Content&) = delete;
  virtual ~Content() = default;

  // What it takes in memory, without its resources. Renderers' budgets count this.
  virtual uint64_t memoryBytes() const = 0;
  // Why it is not the content that tileset.json speaks of, for people: it is the surround where that says none, or the
  // other way round, or it reaches out of the box there. Nothing where it is.
  virtual std::optional<std::string> mismatchWith(const TileContent& promised) const = 0;
};

// A content that is a plain value, of which these are found beside its type:
//   uint64_t bytesInMemory(const T&);
//   std::optional<std::string> mismatchWithTileset(const T&, const TileContent& promised);
template <class T>
class ContentOf final : public Content {
 public:
  explicit ContentOf(T value) : value(std::move(value)) {}

  uint64_t memoryBytes() const override { return bytesInMemory(value); }
  std::optional<std::string> mismatchWith(const TileContent& promised) const override {
    return mismatchWithTileset(value, promised);
  }

  T value;
};

template <class T>
std::unique_ptr<Content> makeContent(T value) {
  return std::make_unique<ContentOf<T>>(std::move(value));
}

// The value of a content that is a ContentOf<T>; CHECKs that it is one.
template <class T>
const T& contentAs(const Content& content) {
  const auto* typed = dynamic_cast<const ContentOf<T>*>(&content);
  CHECK(typed != nullptr);
  return typed->value;
}

// Decodes the contents of one representation. Stateless and there for as long as the program; its functions may be
// called by several threads at a time. Bytes are untrusted: nothing, and why in `reason` (for people), where they are
// not as docs/tile-format.md has them, or would take more memory than the limits allow, which is known before it is
// taken. Where something is returned, `reason` is empty.
class ContentCodec {
 public:
  virtual ~ContentCodec() = default;

  // As tileset.json and contents name the representation.
  virtual std::string_view representation() const = 0;
  // Whether contents of a tile may overlap, which need then no order (tileWithoutOrder).
  virtual bool contentsMayOverlap() const { return false; }

  // What a content will take in memory (Content::memoryBytes), by the JSON of its container alone.
  virtual std::optional<uint64_t> memoryBytes(std::string_view gltfJson, std::string& reason,
                                              const ContentLimits& limits = {}) const = 0;
  // `glb`: the whole file. Null where it is refused.
  virtual std::unique_ptr<Content> decode(std::span<const std::byte> glb, const Resources& resources,
                                          std::string& reason, const ContentLimits& limits = {}) const = 0;

  // What a shared resource will take in memory at most, whose file has so many bytes.
  virtual uint64_t resourceMemoryBytes(const SharedResource&, uint64_t fileBytes) const { return fileBytes; }
  // Null where it is refused, as it is by representations that share nothing.
  virtual std::shared_ptr<const Resource> decodeResource(std::span<const std::byte>, const SharedResource&,
                                                         std::string& reason, const ContentLimits& = {}) const {
    reason = "is a shared resource, which contents of this representation do not have";
    return nullptr;
  }
};

}  // namespace tessera
