// What a tile holds, independently of its representation: decoded contents, the resources that they share, and the
// codec that decodes them from untrusted bytes. Each representation has one codec; code that reads scenes knows a
// representation only through this interface.
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

struct SharedResource;  // declared in tiles/tileset.h
struct TileContent;

// Limits that readers enforce.
struct ContentLimits {
  uint64_t fileBytes = uint64_t{1} << 30;
  uint64_t bytes =
      uint64_t{1} << 30;  // memory of the decoded content; decoding temporarily takes up to two thirds more
  uint32_t parts = 1024;
};

// Data that several contents of a scene need and that is in memory once for all of them: a network, or the table of a
// block.
class Resource {
 public:
  Resource() = default;
  Resource(const Resource&) = delete;
  Resource& operator=(const Resource&) = delete;
  virtual ~Resource() = default;

  virtual uint64_t memoryBytes() const = 0;
};
// The resources of a content, in the order of TileContent::resources. A content that needs them after decoding keeps
// them.
using Resources = std::vector<std::shared_ptr<const Resource>>;

// A decoded content, which satisfies all rules of its format.
class Content {
 public:
  Content() = default;
  Content(const Content&) = delete;
  Content& operator=(const Content&) = delete;
  virtual ~Content() = default;

  // Memory in bytes without shared resources. Renderers count it against their budgets.
  virtual uint64_t memoryBytes() const = 0;
  // Returns why this is not the content that tileset.json declares, as text for people, or nothing if it matches.
  // Reasons are that only one of the two is a background block, or that the content reaches out of the declared box.
  virtual std::optional<std::string> mismatchWith(const TileContent& declared) const = 0;
};

// A content that is a plain value. These two functions must be declared next to its type:
//   uint64_t bytesInMemory(const T&);
//   std::optional<std::string> mismatchWithTileset(const T&, const TileContent& declared);
template <class T>
class ContentOf final : public Content {
 public:
  explicit ContentOf(T value) : value(std::move(value)) {}

  uint64_t memoryBytes() const override { return bytesInMemory(value); }
  std::optional<std::string> mismatchWith(const TileContent& declared) const override {
    return mismatchWithTileset(value, declared);
  }

  T value;
};

template <class T>
std::unique_ptr<Content> makeContent(T value) {
  return std::make_unique<ContentOf<T>>(std::move(value));
}

// Returns the value of a content that is a ContentOf<T>; CHECKs that it is one.
template <class T>
const T& contentAs(const Content& content) {
  const auto* typed = dynamic_cast<const ContentOf<T>*>(&content);
  CHECK(typed != nullptr);
  return typed->value;
}

// Decodes the contents of one representation. Codecs are stateless and live as long as the program; their functions may
// be called by several threads at a time. Bytes are untrusted: if they violate docs/tile-format.md, or would take more
// memory than the limits allow (which is checked before it is allocated), functions return nothing and state why in
// `reason`, for people. Where something is returned, `reason` is empty.
class ContentCodec {
 public:
  virtual ~ContentCodec() = default;

  // The name of the representation in tileset.json and in contents.
  virtual std::string_view representation() const = 0;
  // Whether the contents of a tile may overlap, in which case they need no order (tileWithoutOrder).
  virtual bool contentsMayOverlap() const { return false; }

  // Returns the memory that a content will take (Content::memoryBytes), from the JSON of its container alone.
  virtual std::optional<uint64_t> memoryBytes(std::string_view gltfJson, std::string& reason,
                                              const ContentLimits& limits = {}) const = 0;
  // `glb`: the whole file. Returns null if it is refused.
  virtual std::unique_ptr<Content> decode(std::span<const std::byte> glb, const Resources& resources,
                                          std::string& reason, const ContentLimits& limits = {}) const = 0;

  // Returns an upper bound of the memory that a shared resource with a file of `fileBytes` bytes will take.
  virtual uint64_t resourceMemoryBytes(const SharedResource&, uint64_t fileBytes) const { return fileBytes; }
  // Returns null if the resource is refused, which representations without shared resources always do.
  virtual std::shared_ptr<const Resource> decodeResource(std::span<const std::byte>, const SharedResource&,
                                                         std::string& reason, const ContentLimits& = {}) const {
    reason = "is a shared resource, which contents of this representation do not have";
    return nullptr;
  }
};

}  // namespace tessera
