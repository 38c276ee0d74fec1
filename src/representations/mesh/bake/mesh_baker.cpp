#include "representations/mesh/bake/mesh_baker.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numbers>

#include "bake/levels.h"
#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"
#include "base/log.h"
#include "representations/mesh/bake/patch_order.h"
#include "representations/mesh/content/fallback_mesh.h"
#include "representations/mesh/content/infer_maps.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/train/transient_masks.h"
#include "representations/mesh/train/views_between.h"

namespace tessera {
namespace {

constexpr uint32_t kCellsPerTile = 32;
constexpr uint32_t kCoarseBackgroundPatchEdge = 4;
constexpr const char* kPng = "image/png";
constexpr int kExhaustiveFromEffort = 7;

// A content under way: the parts that have been added, and the textures of its ordinary mesh.
struct GrowingContent {
  MeshContent content;
  std::vector<ImageU8> textures;    // of each part; empty without an ordinary mesh
  std::vector<uint32_t> resources;  // of content.encoders
  bool infersMaps = false;
  SceneBox box{Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
  uint32_t blocksToCome = 0;

  void include(const PatchSet& part) {
    for (uint32_t patch = 0; patch < part.patches; ++patch)
      for (uint32_t number = 0; number < (patch < part.pairs ? 4u : 3u); ++number) {
        box.low = box.low.cwiseMin(part.corner(patch, number));
        box.high = box.high.cwiseMax(part.corner(patch, number));
      }
  }
};

// The encoder of a block, which gives the texels of its contents.
struct BlockEncoder {
  std::shared_ptr<const SharedEncoder> shared;
  std::shared_ptr<MapInference> inference;
  PatchEncoder placement;
  uint32_t resource = 0;  // with inferred maps
};

class MeshBaker final : public Baker {
 public:
  MeshBaker(StoredMesh mesh, const MeshSceneSettings& settings) : mesh_(std::move(mesh)), settings_(settings) {
    const MeshConfig& config = mesh_.config();
    if (settings_.patchEdge == 0) settings_.patchEdge = static_cast<uint32_t>(config.patchTexels);
    tilesPerBlock_ = settings.tilesPerBlock > 0
                         ? settings.tilesPerBlock
                         : std::clamp(std::bit_floor(static_cast<uint32_t>(config.meshCells) / kCellsPerTile), 1u,
                                      kMaxTilesPerBlock);
    grid_ = mesh_.grid();
    grid_.edge /= tilesPerBlock_;
    grid_.columns *= static_cast<int>(tilesPerBlock_);
    grid_.rows *= static_cast<int>(tilesPerBlock_);
    requireValidGrid();
  }

  SceneDescription description() const override {
    SceneDescription about{kMeshName, grid_, mesh_.config().near * tilesPerBlock_};
    for (const StoredMesh::Part& each : mesh_.parts())
      if (each.coverage) about.coverage.push_back(*each.coverage);
    return about;
  }

  // Parts are in memory one after another, blocks row by row: of groups of blocks, only baked patches wait for others.
  void bake(const Capture& given, const BakeOptions& options, ContentSink& sink) override {
    mesh_.warnOfUnfinishedParts("go on with tessera train ... --resume, then bake again");
    options_ = options;
    sink_ = &sink;
    placeOn(frame_, grid_);
    frame_.georeference = given.geo;
    uint32_t levels = 1;
    for (const StoredMesh::Part& each : mesh_.parts()) levels = std::max(levels, each.levels);
    backgroundLevels_ = std::min(levels, 2u);
    int64_t passes = 0, extractions = 0;
    for (const StoredMesh::Part& each : mesh_.parts()) {
      passes += each.part.isBackground() ? backgroundLevels_ : levels;
      for (uint32_t level = 0; level < (each.part.isBackground() ? 1 : levels); ++level)
        extractions += isExtracted(each, level) ? 1 : 0;
    }
    Capture capture = applyTransientMasks(given, mesh_.folder());
    if (extractions > 0)  // triangles are what the photos of the training show
      capture = addViewsBetween(std::move(capture), mesh_.folder(), static_cast<uint64_t>(mesh_.config().seed));
    stepsDone_ = 0;
    steps_ = passes + extractions * static_cast<int64_t>(capture.photosIn(Split::train).size());
    for (uint32_t level = 0; level < levels; ++level) beginLevel(level);
    for (int block = 0; block < mesh_.grid().cells(); ++block) bakeBlock(capture, block);
    if (const StoredMesh::Part* outside = findPart(-1)) bakeBackground(capture, *outside);
  }

 private:
  // Throws Error for what would be refused when the scene is written, after everything has been baked.
  void requireValidGrid() const {
    const std::string remedy =
        tilesPerBlock_ > 1 ? "bake with a lower --tiles-per-block" : "train with fewer and larger --blocks";
    const std::string what = fmt::format("--tiles-per-block {}", tilesPerBlock_);
    if (description().near > 1)
      throw Error(what, "", "the distance from cameras that has no triangles is longer than half a tile",
                  tilesPerBlock_ > 1 ? remedy : "train with a lower --set near");
    constexpr int kMaxAlong = 4096;
    // Of the finest level; coarser ones add a third, and tileset.json must stay within its limits.
    constexpr int64_t kMaxTiles = 5000;
    if (grid_.columns > kMaxAlong || grid_.rows > kMaxAlong || int64_t{grid_.columns} * grid_.rows > kMaxTiles) {
      throw Error(what, "", fmt::format("makes {} x {} tiles, more than a scene holds", grid_.columns, grid_.rows),
                  remedy);
    }
  }

  // The contents of a level: each is a group of tiles, which are cells of the scene's grid.
  struct GrowingLevel {
    LevelGroups groups;
    std::map<uint32_t, GrowingContent> contents;  // by group; those that are finished are removed
  };

  void beginLevel(uint32_t level) {
    GrowingLevel& growing = growing_.emplace_back();
    growing.groups =
        groupsOfLevel(static_cast<uint32_t>(grid_.columns), static_cast<uint32_t>(grid_.rows), level, false);
    for (size_t group = 0; group < growing.groups.cells.size(); ++group) {
      const CellRange& cells = growing.groups.cells[group];
      const auto blocksAlong = [&](int axis) {
        return (cells.end[axis] + tilesPerBlock_ - 1) / tilesPerBlock_ - cells.first[axis] / tilesPerBlock_;
      };
      GrowingContent& content = growing.contents[static_cast<uint32_t>(group)];
      content.blocksToCome = blocksAlong(0) * blocksAlong(1);
      // The textures of several blocks are smaller than their encoders, because their level is coarse.
      content.infersMaps = settings_.inferredMaps && content.blocksToCome == 1;
    }
  }

  // All levels of a block, which has no triangles if it has not been trained.
  void bakeBlock(const Capture& capture, int block) {
    const StoredMesh::Part* const stored = findPart(block);
    const std::unique_ptr<MeshModel> model = stored ? mesh_.load(stored->part, MeshUse::baking) : nullptr;
    for (uint32_t level = 0; level < growing_.size(); ++level) {
      GrowingLevel& growing = growing_[level];
      const std::vector<uint32_t> groups = findGroups(growing.groups, block);
      if (model) addBlock(capture, *model, level, groups, growing);
      for (const uint32_t group : groups) {
        GrowingContent& content = growing.contents[group];
        if (--content.blocksToCome > 0) continue;
        finish(level, growing.groups.cells[group], content);
        growing.contents.erase(group);
      }
    }
  }

  void addBlock(const Capture& capture, MeshModel& model, uint32_t level, const std::vector<uint32_t>& groups,
                GrowingLevel& growing) {
    std::map<uint32_t, std::vector<uint32_t>> patchesOfGroup;
    for (const uint32_t group : groups) patchesOfGroup[group];
    const BakedPatches baked = bakePart(capture, model, level);
    reportStep();
    for (uint32_t patch = 0; patch < baked.patches(); ++patch) {
      const Vec3d at = sceneFromPart(model) * baked.centre(patch);
      patchesOfGroup[groupAt(growing.groups, model.part().block, at)].push_back(patch);
    }
    std::optional<BlockEncoder> encoder;
    if (!isFitted(model, level)) encoder = makeBlockEncoder(model, level);
    for (const auto& [group, patches] : patchesOfGroup)
      addPatches(baked, patches, model, encoder ? &*encoder : nullptr, growing.contents[group]);
  }

  void bakeBackground(const Capture& capture, const StoredMesh::Part& outside) {
    const std::unique_ptr<MeshModel> loaded = mesh_.load(outside.part, MeshUse::baking);
    MeshModel& model = *loaded;
    const FaceSet faces = listFaces(capture, model, 0);
    for (uint32_t level = 0; level < backgroundLevels_; ++level) bakeBackground(model, faces, level);
  }

  // The coarse level has the same triangles, with few texels and without an ordinary mesh: other programs than ours
  // show all contents of the root at once.
  void bakeBackground(MeshModel& model, const FaceSet& faces, uint32_t level) {
    MeshBakeSettings settings;
    settings.patchEdge = level == 0 ? settings_.patchEdge : kCoarseBackgroundPatchEdge;
    settings.placesPerEdge = level == 0 ? 0 : kMaxPlacesPerEdge;
    settings.baseColours = settings_.fallback && level == 0;
    const BakedPatches baked = bakePatches(model, 0, faces, settings);
    reportStep();
    GrowingContent growing;
    growing.content.isBackground = true;
    growing.content.skyEdge = MeshModel::kSkyResolution;
    for (const float number : model.device().read(model.sky().values.all()))
      growing.content.sky.push_back(FeatureRange{0, 1}.encode(number));
    // Far triangles are larger: sets of similar distances, so that the steps of positions suit all of them.
    std::map<int, std::vector<uint32_t>> byDistance;
    for (uint32_t patch = 0; patch < baked.patches(); ++patch) {
      Vec3d x = baked.centre(patch);
      for (int axis = 0; axis < 3; ++axis) x[axis] /= model.part().halfEdges[axis];
      byDistance[static_cast<int>(std::floor(std::log2(std::max(1.0, x.cwiseAbs().maxCoeff()))))].push_back(patch);
    }
    for (const auto& [octave, patches] : byDistance) addPatches(baked, patches, model, nullptr, growing);
    finish(level, std::nullopt, growing);
  }

  void reportStep() { options_.onStep(++stepsDone_, steps_); }

  // The part of a block, -1: of the outside; null if it has not been trained.
  const StoredMesh::Part* findPart(int block) const {
    const auto part = std::find_if(mesh_.parts().begin(), mesh_.parts().end(),
                                   [&](const StoredMesh::Part& each) { return each.part.block == block; });
    return part == mesh_.parts().end() ? nullptr : &*part;
  }
  // The level of a part that a level of the scene shows: the coarsest, if it has fewer.
  static uint32_t findModelLevel(MeshModel& model, uint32_t level) { return std::min(level, model.levels() - 1); }
  // Whether the level has texels of its own.
  static bool isFitted(MeshModel& model, uint32_t level) {
    return model.coarseAtlas(findModelLevel(model, level)) != nullptr;
  }
  // Whether the faces are not those of the final stage of training, so that the photos must be looked through.
  bool isExtracted(const StoredMesh::Part& part, uint32_t level) const {
    return !part.hasAtlas || (std::min(level, part.levels - 1) > 0 && !mesh_.config().fitsLevels());
  }
  static bool isExtracted(MeshModel& model, uint32_t level) {
    return findModelLevel(model, level) == 0 ? !model.atlas() : !isFitted(model, level);
  }

  BakedPatches bakePart(const Capture& capture, MeshModel& model, uint32_t sceneLevel) {
    const uint32_t level = findModelLevel(model, sceneLevel);
    MeshBakeSettings settings;
    settings.patchEdge = settings_.patchEdge;
    settings.baseColours = settings_.fallback;
    // Else MapInference makes them.
    settings.texels = settings_.fallback || isFitted(model, sceneLevel);
    if (isFitted(model, sceneLevel)) settings.patchEdge = model.atlas()->patchEdge;
    return bakePatches(model, level, listFaces(capture, model, sceneLevel), settings);
  }

  FaceSet listFaces(const Capture& capture, MeshModel& model, uint32_t sceneLevel) {
    const uint32_t level = findModelLevel(model, sceneLevel);
    if (isFitted(model, sceneLevel)) return model.coarseAtlas(level)->faces;
    if (!isExtracted(model, sceneLevel)) return model.atlas()->faces;
    ExtractionSettings extraction;
    extraction.photoStride = options_.stride << level;
    // Triangles of coarse levels are few, and holes in them are large.
    if (level == 0) extraction.droppedShare = model.config().droppedShare;
    extraction.dilation = model.config().dilation;
    if (model.part().isBackground()) extraction.raysPerCell = 0;
    return extractFaces(model, level, capture, nullptr, extraction, [this](int64_t, int64_t) { reportStep(); });
  }

  SceneFromPart sceneFromPart(const MeshModel& model) const {
    const SceneFrame& frame = model.frame();
    return {1 / (frame.scale * frame_.worldFromScene.scale), frame_.worldFromScene.undo(frame.centre)};
  }

  // The groups that lie in a block, or that contain it.
  std::vector<uint32_t> findGroups(const LevelGroups& groups, int block) const {
    std::vector<uint32_t> all;
    for (uint32_t j = 0; j < tilesPerBlock_; ++j)
      for (uint32_t i = 0; i < tilesPerBlock_; ++i) all.push_back(groupOfTile(groups, block, i, j));
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  }
  uint32_t groupOfTile(const LevelGroups& groups, int block, uint32_t i, uint32_t j) const {
    const uint32_t columns = static_cast<uint32_t>(mesh_.grid().columns), at = static_cast<uint32_t>(block);
    const uint32_t column = at % columns * tilesPerBlock_ + i, row = at / columns * tilesPerBlock_ + j;
    return groups.groupOfBlock[column + static_cast<uint32_t>(grid_.columns) * row];
  }
  // The group of a point in a block; points beyond its walls count as at the wall.
  uint32_t groupAt(const LevelGroups& groups, int block, const Vec3d& xInScene) const {
    const int columns = mesh_.grid().columns, tiles = static_cast<int>(tilesPerBlock_);
    const auto tile = [&](double at, int cells, int first) {
      return static_cast<uint32_t>(std::clamp(static_cast<int>(std::floor((at + cells) / 2)) - first, 0, tiles - 1));
    };
    return groupOfTile(groups, block, tile(xInScene.x(), grid_.columns, block % columns * tiles),
                       tile(xInScene.y(), grid_.rows, block / columns * tiles));
  }

  BlockEncoder makeBlockEncoder(MeshModel& model, uint32_t sceneLevel) const {
    const MeshConfig& config = model.config();
    MeshEncoder encoder;
    encoder.grid = {config.gridLevels, config.gridFeatures, config.gridLog2Size, config.gridBase, config.gridFinest};
    encoder.width = static_cast<uint32_t>(config.width);
    encoder.hiddenLayers = static_cast<uint32_t>(config.hidden);
    encoder.opacityOffset = model.opacityOffset();
    const auto [table, weights] =
        model.device().readAll(model.field().table().values.all(), model.field().encoder().values.all());
    encoder.table.resize(table.size());
    std::transform(table.begin(), table.end(), encoder.table.begin(), toHalf);
    forEachWeight(encoder.shape(),
                  [&, &all = weights](size_t, size_t index) { encoder.weights.push_back(toHalf(all[index])); });
    PatchEncoder placement;
    const uint32_t level = findModelLevel(model, sceneLevel);
    const OctahedraGrid& grid = model.level(level).domain().grids[0];
    const SceneFromPart place = sceneFromPart(model);
    for (size_t axis = 0; axis < 3; ++axis) {
      const double scale = double{grid.positionScale()};
      placement.scale[axis] = scale * grid.gridFromScene[5 * axis] / place.scale;
      placement.offset[axis] = scale * (double{grid.gridFromScene[4 * axis + 3]} + grid.positionOffset[axis]) -
                               placement.scale[axis] * place.translation[static_cast<int>(axis)];
    }
    placement.places = placesPerEdge(level);
    placement.opaqueFrom = MeshBakeSettings().opaqueFrom;
    placement.transparentBelow = MeshBakeSettings().transparentBelow;
    uint32_t resource = 0;
    if (settings_.inferredMaps) {
      const int block = model.part().block, columns = mesh_.grid().columns;
      resource = sink_->addResource(fmt::format("encoder_{}_{}", block % columns, block / columns), kEncoderMimeType,
                                    encodeMeshEncoder(encoder));
    }
    auto inference = std::make_shared<MapInference>(mesh_.device(), encoder);
    return {std::make_shared<SharedEncoder>(std::move(encoder)), std::move(inference), placement, resource};
  }

  // Adds the patches as one part, or several if they do not fit one. `encoder`: of a block, if its texels are the
  // encoder's output.
  void addPatches(const BakedPatches& baked, const std::vector<uint32_t>& patches, const MeshModel& model,
                  const BlockEncoder* encoder, GrowingContent& to) const {
    const Bc4Effort effort = options_.effort >= kExhaustiveFromEffort ? Bc4Effort::exhaustive : Bc4Effort::fast;
    const size_t most = maxPatches(baked.patchEdge);
    const std::vector<uint32_t> ordered = orderPatches(baked, patches);
    for (size_t first = 0; first < ordered.size(); first += most) {
      const auto some = std::span(ordered).subspan(first, std::min(most, ordered.size() - first));
      const SceneFromPart placement = sceneFromPart(model);
      PatchSet& part = to.content.parts.emplace_back(encoder ? arrangePatches(baked, some, placement)
                                                             : compressPatches(baked, some, placement, effort));
      if (encoder) setMaps(*encoder, effort, to);
      to.include(part);
      if (!baked.baseColours.empty()) to.textures.push_back(makeBaseColourTexture(baked, some, part));
    }
  }

  // Sets the maps of the content's last part, or its encoder.
  void setMaps(const BlockEncoder& encoder, Bc4Effort effort, GrowingContent& to) const {
    PatchSet& part = to.content.parts.back();
    part.encoder = encoder.placement;
    if (to.infersMaps) {
      to.content.encoders = {encoder.shared};
      to.resources = {encoder.resource};
    } else {
      encoder.inference->infer(part, effort);
      part.encoder.reset();
    }
  }

  void finish(uint32_t level, const std::optional<CellRange>& cells, GrowingContent& growing) const {
    MeshContent& content = growing.content;
    ContentSummary summary;
    if (content.parts.empty()) {  // a place without triangles
      content.parts.push_back(emptyPart());
      growing.textures.clear();
    }
    summary.isBackground = content.isBackground;
    const SceneBox around = cells ? frame_.boxFromCells(*cells) : frame_.box();
    if (growing.box.low.x() <= growing.box.high.x()) {
      constexpr double kLeastExtent = 1e-6;  // flat boxes are invalid
      summary.box.low = growing.box.low - Vec3d::Constant(kLeastExtent);
      summary.box.high = growing.box.high + Vec3d::Constant(kLeastExtent);
    } else {
      summary.box = around;
    }
    if (!cells) {  // the far box contains the scene's
      summary.box.low = summary.box.low.cwiseMin(around.low);
      summary.box.high = summary.box.high.cwiseMax(around.high);
    }
    // A coarser level may have finer texels than the finest one: with --texels below patch_texels.
    for (uint32_t finer = 0; finer <= level; ++finer)
      summary.geometricError = std::max(summary.geometricError, texelEdge(finer, content.isBackground));
    summary.memoryBytes = bytesInMemory(content);
    uint64_t patches = 0, textureBytes = 0;
    for (const PatchSet& part : content.parts) patches += part.patches;
    ContentFileWriter file;
    FallbackMesh fallback(file, frame_.tileFromScene());
    for (size_t i = 0; i < growing.textures.size(); ++i) {
      const Bytes png = encodePng(growing.textures[i]);
      const uint32_t resource = sink_->addResource(textureName(level, cells, i), kPng, png);
      textureBytes += png.size();
      fallback.add(content.parts[i], pngAt("../../" + sink_->resourceUri(resource)));
    }
    summary.counts = {{"triangles", content.triangles()}, {"patches", patches}, {"fallback_bytes", textureBytes}};
    sink_->add(level, cells, encodeMesh(content, std::move(file), fallback.scene()), summary, growing.resources);
  }

  static std::string textureName(uint32_t level, const std::optional<CellRange>& cells, size_t part) {
    if (!cells) return fmt::format("L{}_background_block_{}", level, part);
    return fmt::format("L{}_block_{}_{}_{}", level, cells->first[0], cells->first[1], part);
  }

  // A part without patches, with a network that fits.
  static PatchSet emptyPart() {
    PatchSet part;
    DenseLayer layer{kMeshFeatures + kMeshHarmonics, 3, {}, {}};
    layer.weights.resize(size_t{layer.inputs} * 3);
    layer.biases.resize(3);
    part.decoder = {layer};
    return part;
  }

  // The distance between texels on the longest edge of a triangle, in scene units.
  double texelEdge(uint32_t level, bool isBackground) const {
    const MeshConfig& config = mesh_.config();
    const double region = std::max({2.0 * grid_.columns, 2.0 * grid_.rows, frame_.top - frame_.bottom});
    const double cell = isBackground ? region / config.backgroundCells
                                     : 2.0 * tilesPerBlock_ / (1 - 2 * kBlockMargin) / (config.meshCells >> level);
    uint32_t patchEdge = settings_.patchEdge;
    if (level > 0 && isBackground) patchEdge = kCoarseBackgroundPatchEdge;
    if (level > 0 && !isBackground && config.fitsLevels()) patchEdge = static_cast<uint32_t>(config.patchTexels);
    return std::numbers::sqrt2 * cell / (patchEdge - 1);
  }

  StoredMesh mesh_;
  MeshSceneSettings settings_;
  uint32_t tilesPerBlock_ = 1;
  BlockGrid grid_;  // of tiles
  Tileset frame_;   // only its frames and its grid
  BakeOptions options_;
  ContentSink* sink_ = nullptr;
  std::vector<GrowingLevel> growing_;
  uint32_t backgroundLevels_ = 1;
  int64_t steps_ = 0, stepsDone_ = 0;  // BakeOptions::onStep
};

}  // namespace

std::unique_ptr<Baker> makeMeshBaker(StoredMesh mesh, const MeshSceneSettings& settings) {
  return std::make_unique<MeshBaker>(std::move(mesh), settings);
}

}  // namespace tessera
