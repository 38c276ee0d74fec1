#include "world/gltf_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numeric>

#include "base/error.h"
#include "tiles/glb.h"
#include "tiles/json_fields.h"
#include "world/gltf_accessors.h"
#include "world/world_text.h"

namespace tessera {
namespace {

using json_fields::getArray;
using json_fields::getField;
using json_fields::getNumber;
using json_fields::getNumbers;
using json_fields::getString;
using json_fields::getUnsigned;
using nlohmann::json;

constexpr int kDeepestJson = 64;
constexpr size_t kMaxJsonValues = 8'000'000, kMaxNodes = 1'000'000;
constexpr std::string_view kGlbMagic = "glTF";

enum Mode : uint32_t { kTriangles = 4, kStrip = 5, kFan = 6 };

// How a texture's places follow from those of a vertex (KHR_texture_transform).
struct PlaceRule {
  uint32_t set = 0;  // TEXCOORD_n
  std::array<double, 2> offset = {0, 0}, scale = {1, 1};
  double rotation = 0;  // radians, anticlockwise

  bool operator==(const PlaceRule&) const = default;
  std::array<float, 2> apply(float u, float v) const {
    const double c = std::cos(rotation), s = std::sin(rotation), x = scale[0] * u, y = scale[1] * v;
    return {static_cast<float>(c * x + s * y + offset[0]), static_cast<float>(c * y - s * x + offset[1])};
  }
};

// Counts the values of a text, and stops where it is nested too deep or has too many.
class GltfSize final : public nlohmann::json_sax<json> {
 public:
  bool isTooDeep() const { return depth_ > kDeepestJson; }
  bool isTooLarge() const { return values_ > kMaxJsonValues; }

  bool null() override { return count(); }
  bool boolean(bool) override { return count(); }
  bool number_integer(number_integer_t) override { return count(); }
  bool number_unsigned(number_unsigned_t) override { return count(); }
  bool number_float(number_float_t, const string_t&) override { return count(); }
  bool string(string_t&) override { return count(); }
  bool binary(binary_t&) override { return count(); }
  bool key(string_t&) override { return count(); }
  bool start_object(std::size_t) override { return begin(); }
  bool start_array(std::size_t) override { return begin(); }
  bool end_object() override { return end(); }
  bool end_array() override { return end(); }
  bool parse_error(std::size_t, const std::string&, const nlohmann::detail::exception&) override { return false; }

 private:
  bool count() { return ++values_ <= kMaxJsonValues; }
  bool begin() { return ++depth_ <= kDeepestJson && count(); }
  bool end() {
    --depth_;
    return true;
  }

  int depth_ = 0;
  size_t values_ = 0;
};

json parseGltf(std::string_view text, const ModelAssembler& to) {
  // A pass of its own: parsing with a callback takes time that grows with the square of the length.
  GltfSize size;
  const bool isJson = json::sax_parse(text, &size);
  if (size.isTooDeep()) to.refuse("", "is nested too deep", kExportModelAgain);
  if (size.isTooLarge()) to.refuse("", "has too many values", kExportModelAgain);
  if (!isJson) to.refuse("", "is not a glTF file, or is cut off", kExportModelAgain);
  return json::parse(text);
}

class GltfReader {
 public:
  GltfReader(const json& gltf, std::span<const std::byte> binary, ModelAssembler& to, const ModelLimits& limits)
      : gltf_(gltf), accessors_(gltf, binary, to, limits), to_(to) {}

  void read() {
    addMaterials();
    checkNodes();
    for (const uint64_t root : roots_) addNode(root, Mat4d::Identity(), 0);
  }

 private:
  [[noreturn]] void refuse(const std::string& place, const std::string& reason) const {
    to_.refuse(place, reason, kExportModelAgain);
  }
  const json& all(const char* kind) const {
    static const json kNone = json::array();
    const json* all = getArray(gltf_, kind);
    return all == nullptr ? kNone : *all;
  }

  // Adds the image of a texture and returns its number in the model; -1 if it cannot be used.
  int addTexture(const json* info) {
    if (info == nullptr) return -1;
    const auto number = getUnsigned(*info, "index");
    if (!number || *number >= all("textures").size()) return -1;
    const auto source = getUnsigned(all("textures")[*number], "source");
    if (!source || *source >= all("images").size()) {  // of an extension, for example
      return to_.addTexture(fmt::format("*textures[{}]", *number), {});
    }
    const auto known = images_.find(*source);
    if (known != images_.end()) return known->second;
    return images_[*source] = addImage(*source);
  }

  int addImage(uint64_t source) {
    const json& image = all("images")[source];
    const std::string key = fmt::format("images[{}]", source);
    if (const auto view = getUnsigned(image, "bufferView")) return to_.addTexture("*" + key, accessors_.view(*view));
    const std::string* uri = getString(image, "uri");
    if (uri == nullptr) return to_.addTexture("*" + key, {});
    if (!isDataUri(*uri)) return to_.addTexture(*uri);
    const auto bytes = decodeDataUri(*uri);
    return to_.addTexture("*" + key, bytes ? std::span<const std::byte>(*bytes) : std::span<const std::byte>());
  }

  static PlaceRule placeRule(const json& info) {
    PlaceRule rule;
    rule.set = getUnsigned(info, "texCoord").value_or(0);
    const json* extensions = getField(info, "extensions");
    const json* transform = extensions == nullptr ? nullptr : getField(*extensions, "KHR_texture_transform");
    if (transform == nullptr) return rule;
    rule.set = getUnsigned(*transform, "texCoord").value_or(rule.set);
    rule.offset = getNumbers<2>(*transform, "offset").value_or(rule.offset);
    rule.scale = getNumbers<2>(*transform, "scale").value_or(rule.scale);
    rule.rotation = getNumber(*transform, "rotation").value_or(0);
    return rule;
  }

  void addMaterials() {
    for (const json& from : all("materials")) {
      ModelMaterial& material = to_.addMaterial();
      const json none = json::object();
      const json* physical = getField(from, "pbrMetallicRoughness");
      if (physical == nullptr) physical = &none;
      const json* extensions = getField(from, "extensions");
      const auto extension = [&](const char* name) {
        return extensions == nullptr ? nullptr : getField(*extensions, name);
      };
      const auto factor = [](const json& object, const char* key) {
        return unitShare(static_cast<float>(getNumber(object, key).value_or(1)));
      };
      const std::array<double, 4> base =
          getNumbers<4>(*physical, "baseColorFactor").value_or(std::array<double, 4>{1, 1, 1, 1});
      for (size_t c = 0; c < 3; ++c) material.baseColour[c] = unitShare(static_cast<float>(base[c]));
      material.opacity = unitShare(static_cast<float>(base[3]));
      const std::string* mode = getString(from, "alphaMode");
      if (mode != nullptr && *mode == "MASK") {
        material.cutoff = unitShare(static_cast<float>(getNumber(from, "alphaCutoff").value_or(0.5)));
      }
      if (mode != nullptr && *mode == "BLEND") material.cutoff = 0.5f;
      if (const json* glass = extension("KHR_materials_transmission")) {  // as in the browser
        const double through = getNumber(*glass, "transmissionFactor").value_or(0);
        if (through > 0) {
          material.opacity *= 1 - 0.7f * unitShare(static_cast<float>(through));
          material.cutoff = 0.5f;
        }
      }
      material.isDoubleSided = json_fields::getBoolean(from, "doubleSided").value_or(false);
      material.isLit = extension("KHR_materials_unlit") == nullptr;
      material.metalness = factor(*physical, "metallicFactor");
      material.roughness = factor(*physical, "roughnessFactor");
      const std::array<double, 3> emission =
          getNumbers<3>(from, "emissiveFactor").value_or(std::array<double, 3>{0, 0, 0});
      const json* strength = extension("KHR_materials_emissive_strength");
      const double times = strength == nullptr ? 1 : getNumber(*strength, "emissiveStrength").value_or(1);
      for (size_t c = 0; c < 3; ++c) material.emission[c] = unitShare(static_cast<float>(emission[c] * times));
      addTextures(*physical, from, material);
    }
  }

  // A vertex has one place, that of the first texture: the others are used if theirs is the same.
  void addTextures(const json& physical, const json& from, ModelMaterial& material) {
    std::optional<PlaceRule> rule;
    const auto add = [&](const json* info) {
      if (info == nullptr || (rule && *rule != placeRule(*info))) return -1;
      const int number = addTexture(info);
      if (number >= 0) rule = placeRule(*info);
      return number;
    };
    material.texture = add(getField(physical, "baseColorTexture"));
    const json* surface = getField(physical, "metallicRoughnessTexture");
    const json* emission = getField(from, "emissiveTexture");
    material.surfaceTexture = add(surface);
    material.emissionTexture = add(emission);
    // The factors alone would make it a mirror, or a lamp.
    if (surface != nullptr && material.surfaceTexture < 0) {
      material.metalness = 0;
      material.roughness = 1;
    }
    if (emission != nullptr && material.emissionTexture < 0) material.emission = {0, 0, 0};
    rules_.push_back(rule.value_or(PlaceRule()));
  }

  // Each node has at most one parent, and none is its own ancestor: the nodes are trees.
  void checkNodes() {
    const json& nodes = all("nodes");
    if (nodes.size() > kMaxNodes) refuse("nodes", "are too many");
    std::vector<bool> hasParent(nodes.size(), false);
    for (size_t i = 0; i < nodes.size(); ++i) {
      const json* children = getArray(nodes[i], "children");
      if (children == nullptr) continue;
      for (const json& child : *children) {
        const auto number = json_fields::unsignedFrom(child, nodes.size());
        const std::string place = fmt::format("nodes[{}].children", i);
        if (!number || *number >= nodes.size()) refuse(place, "name no node");
        if (hasParent[*number]) refuse(place, "name a node that has another parent, or is its own ancestor");
        hasParent[*number] = true;
      }
    }
    const uint64_t scene = getUnsigned(gltf_, "scene").value_or(0);
    const json* roots = scene < all("scenes").size() ? getArray(all("scenes")[scene], "nodes") : nullptr;
    if (roots == nullptr) {
      for (size_t i = 0; i < nodes.size(); ++i)
        if (!hasParent[i]) roots_.push_back(i);
      return;
    }
    for (const json& root : *roots) {
      const auto number = json_fields::unsignedFrom(root, nodes.size());
      const std::string place = fmt::format("scenes[{}].nodes", scene);
      if (!number || *number >= nodes.size()) refuse(place, "name no node");
      if (hasParent[*number]) refuse(place, "name a node that has a parent");
      hasParent[*number] = true;
      roots_.push_back(*number);
    }
  }

  Mat4d nodeMatrix(const json& node) const {
    if (const auto values = getNumbers<16>(node, "matrix")) {
      Mat4d matrix = Eigen::Map<const Mat4d>(values->data());  // by columns in both
      matrix.row(3) = Eigen::RowVector4d(0, 0, 0, 1);
      return matrix;
    }
    const auto shift = getNumbers<3>(node, "translation").value_or(std::array<double, 3>{0, 0, 0});
    const auto turn = getNumbers<4>(node, "rotation").value_or(std::array<double, 4>{0, 0, 0, 1});
    const auto scale = getNumbers<3>(node, "scale").value_or(std::array<double, 3>{1, 1, 1});
    Eigen::Quaterniond quaternion(turn[3], turn[0], turn[1], turn[2]);
    if (!(quaternion.norm() > 1e-6)) quaternion = Eigen::Quaterniond::Identity();
    Mat4d matrix = Mat4d::Identity();
    matrix.topLeftCorner<3, 3>() =
        quaternion.normalized().toRotationMatrix() * Vec3d(scale[0], scale[1], scale[2]).asDiagonal();
    matrix.topRightCorner<3, 1>() = Vec3d(shift[0], shift[1], shift[2]);
    return matrix;
  }

  void addNode(uint64_t index, const Mat4d& above, size_t nesting) {
    if (nesting > kMaxModelNesting) {
      to_.refuse(fmt::format("nodes[{}]", index), "is nested too deep", "export it again, with fewer groups in groups");
    }
    const json& node = all("nodes")[index];
    const Mat4d toModel = above * nodeMatrix(node);
    if (const auto mesh = getUnsigned(node, "mesh")) addMesh(*mesh, toModel);
    const json* children = getArray(node, "children");
    if (children == nullptr) return;
    for (const json& child : *children) addNode(child.get<uint64_t>(), toModel, nesting + 1);
  }

  void addMesh(uint64_t index, const Mat4d& toModel) {
    const std::string place = fmt::format("meshes[{}]", index);
    if (index >= all("meshes").size()) refuse(place, "is missing");
    const json* primitives = getArray(all("meshes")[index], "primitives");
    if (primitives == nullptr) refuse(place, "has no primitives");
    for (size_t i = 0; i < primitives->size(); ++i) {
      addPrimitive((*primitives)[i], fmt::format("{}.primitives[{}]", place, i), toModel);
    }
  }

  void addPrimitive(const json& primitive, const std::string& place, const Mat4d& toModel) {
    accessors_.spend(100);
    const uint32_t mode = getUnsigned(primitive, "mode").value_or(kTriangles);
    if (mode != kTriangles && mode != kStrip && mode != kFan) return;  // points or lines
    const json* attributes = getField(primitive, "attributes");
    const auto positions = attributes == nullptr ? std::nullopt : getUnsigned(*attributes, "POSITION");
    if (!positions) return;
    const uint64_t count = accessors_.count(*positions);
    const bool isIndexed = getField(primitive, "indices") != nullptr;
    const auto indices = getUnsigned(primitive, "indices");
    if (isIndexed && !indices) refuse(place + ".indices", "name no accessor");
    const uint64_t corners = isIndexed ? accessors_.count(*indices) : count;
    to_.requireRoom(mode == kTriangles ? corners / 3 : corners, 0);
    ModelPart part;
    part.material = materialNumber(primitive, place);
    std::vector<uint32_t> order(isIndexed ? 0 : corners);
    std::iota(order.begin(), order.end(), 0);
    if (isIndexed) order = accessors_.indices(*indices);
    const auto beyond = std::find_if(order.begin(), order.end(), [&](uint32_t corner) { return corner >= count; });
    if (beyond != order.end()) refuse(place + ".indices", fmt::format("name corner {} of {}", *beyond, count));
    part.corners = triangulate(order, mode);
    if (part.corners.empty()) return;
    const std::vector<uint32_t> used = keepUsed(part.corners);
    const auto attribute = [&](const std::string& name) -> std::optional<uint32_t> {
      const auto number = getUnsigned(*attributes, name.c_str());
      if (number && accessors_.count(*number) != count) refuse(place + "." + name, "has another count than positions");
      return number;
    };
    part.positions = vectors(*positions, used);
    if (const auto normals = attribute("NORMAL")) part.normals = vectors(*normals, used);
    const PlaceRule rule = rules_[part.material];
    if (const auto places = attribute(fmt::format("TEXCOORD_{}", rule.set))) {
      const std::vector<float> numbers = accessors_.floats(*places, 2, used);
      for (size_t i = 0; i < used.size(); ++i) part.places.push_back(rule.apply(numbers[2 * i], numbers[2 * i + 1]));
    }
    if (const auto colours = attribute("COLOR_0")) {
      const std::vector<float> numbers = accessors_.floats(*colours, 4, used, 1);
      for (size_t i = 0; i < used.size(); ++i) {
        part.colours.push_back(
            packColour({numbers[4 * i], numbers[4 * i + 1], numbers[4 * i + 2], numbers[4 * i + 3]}));
      }
    }
    to_.add(part, toModel);
  }

  // Returns the vertices that corners name, in ascending order, and renumbers the corners: primitives often share
  // accessors of which each uses a part.
  static std::vector<uint32_t> keepUsed(std::vector<uint32_t>& corners) {
    std::vector<uint32_t> used = corners;
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (uint32_t& corner : corners) {
      corner = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), corner) - used.begin());
    }
    return used;
  }

  std::vector<Vec3f> vectors(uint64_t accessor, std::span<const uint32_t> elements) const {
    const std::vector<float> numbers = accessors_.floats(accessor, 3, elements);
    std::vector<Vec3f> vectors(elements.size());
    for (size_t i = 0; i < vectors.size(); ++i) vectors[i] = {numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
    return vectors;
  }

  // Primitives without a material have one of their own, after all others.
  uint32_t materialNumber(const json& primitive, const std::string& place) {
    if (const auto number = getUnsigned(primitive, "material")) {
      if (*number >= rules_.size()) refuse(place + ".material", "is missing");
      return *number;
    }
    if (!plain_) {
      plain_ = static_cast<uint32_t>(rules_.size());
      ModelMaterial& material = to_.addMaterial();
      material.roughness = 1;
      material.metalness = 1;
      rules_.push_back(PlaceRule());
    }
    return *plain_;
  }

  static std::vector<uint32_t> triangulate(const std::vector<uint32_t>& order, uint32_t mode) {
    if (mode == kTriangles) return {order.begin(), order.begin() + static_cast<ptrdiff_t>(order.size() / 3 * 3)};
    std::vector<uint32_t> corners;
    for (size_t i = 2; i < order.size(); ++i) {
      const size_t turned = mode == kStrip ? i % 2 : 0, first = mode == kStrip ? i - 2 : 0;
      const uint32_t triangle[] = {order[first], order[i - 1 + turned], order[i - turned]};
      corners.insert(corners.end(), std::begin(triangle), std::end(triangle));
    }
    return corners;
  }

  const json& gltf_;
  GltfAccessors accessors_;
  ModelAssembler& to_;
  std::vector<uint64_t> roots_;
  std::vector<PlaceRule> rules_;  // of each material
  std::optional<uint32_t> plain_;
  std::map<uint64_t, int> images_;  // their textures
};

}  // namespace

void readGltf(const Bytes& file, ModelAssembler& to, const ModelLimits& limits) {
  std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  std::span<const std::byte> binary;
  if (text.starts_with(kGlbMagic)) {
    const auto glb = decodeGlb(file);
    if (!glb) to.refuse("", "is not a GLB of version 2, or is cut off", kExportModelAgain);
    text = glb->json;
    binary = glb->bytes;
  }
  const json gltf = parseGltf(text, to);
  const json* asset = getField(gltf, "asset");
  const std::string* version = asset == nullptr ? nullptr : getString(*asset, "version");
  if (version == nullptr || !version->starts_with("2.")) to.refuse("asset", "is not glTF 2.0", "export it as glTF 2.0");
  const json* required = getArray(gltf, "extensionsRequired");
  for (const json& name : required == nullptr ? json::array() : *required) {
    if (name == "KHR_draco_mesh_compression") {
      to.refuse("", "uses KHR_draco_mesh_compression, which is not read here", "export it without Draco compression");
    }
    if (name.is_string() && name.get_ref<const std::string&>().ends_with("_meshopt_compression")) {
      to.refuse("", "uses meshopt compression, which only the browser reads", "export it without compression");
    }
  }
  GltfReader(gltf, binary, to, limits).read();
}

}  // namespace tessera
