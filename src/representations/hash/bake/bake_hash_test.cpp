#include "representations/hash/bake/bake_hash.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "compute/block_path.h"
#include "render/tile_scene.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/cpu/hash_march.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/hash/testing/hash_renderer.h"
#include "representations/hash/train/hash_model_renderer.h"
#ifdef TESSERA_HAS_VULKAN
#include "gpu/testing/test_context.h"
#endif

namespace tessera {
namespace {

// A model of the cube in two blocks, and the cells that the photos see.
struct Baked {
  CubeScene scene;
  TrainedHashCube trained;
  std::vector<OccupancyBits> seen;

  explicit Baked(const HashConfig& config, uint32_t cells = 32)
      : trained(scene, config, cubeGrid(2), 120),
        seen(findSeenCells(trained.model(), scene.capture(), makeBakeOptions(cells))) {}
  static BakeHashOptions makeBakeOptions(uint32_t cells) {
    BakeHashOptions options;
    options.cells = cells;
    return options;
  }
  HashContent block(uint32_t number) { return bakeHashGroup(trained.model(), {number}, seen); }
};

bool looksUp(const HashContent& content, const HashPart& part, const float place[3], float features[8]) {
  const HashFeatures at(content, part);
  HashFeatures::Lookup lookup;
  if (!at.find(place, lookup)) return false;
  at.mix(lookup, features);
  return true;
}

size_t countSetBits(const OccupancyBits& bits) {
  size_t count = 0;
  for (size_t i = 0; i < bits.count(); ++i) count += bits.at(i);
  return count;
}

TEST(BakeHash, KeepsTheCellsOfTheCubeAndFewOthers) {
  Baked baked((smallHashConfig()));
  for (const OccupancyBits& bits : baked.seen) {
    EXPECT_GT(countSetBits(bits), bits.count() / 100);
    EXPECT_LT(countSetBits(bits), bits.count() / 2);
  }
}

// Invariant 6 of `hash` (docs/invariants.md), up to the quantisation to bytes.
TEST(BakeHash, StoresTheFeaturesOfTheModelInEveryVisibleCell) {
  for (const bool varies : {true, false}) {
    HashConfig config = smallHashConfig();
    config.attentionVaries = varies;
    config.attention = varies ? "separate" : "shared";
    Baked baked(config);
    Device& device = *baked.trained.device;
    const uint32_t block = 1;
    const HashContent content = baked.block(block);
    const HashPart& part = content.parts[0];
    // Random places in visible cells.
    const RandomStream random(5, 5);
    std::vector<float> positions;
    const OccupancyBits& seen = baked.seen[block];
    for (size_t number = 0; number < seen.count(); number += 3) {
      if (!seen.at(number)) continue;
      const size_t n = seen.cells, cell[3] = {number % n, number / n % n, number / n / n};
      for (size_t a = 0; a < 3; ++a) {
        positions.push_back((static_cast<float>(cell[a]) + random.uniform(3 * number + a)) / static_cast<float>(n));
      }
    }
    const uint32_t count = static_cast<uint32_t>(positions.size() / 3);
    ASSERT_GT(count, 300u);
    const Array<float> at = device.uploadArray(positions);
    const Array<uint32_t> slots = device.uploadArray(std::vector<uint32_t>(count, block));
    HashFields& fields = baked.trained.model().fields();
    fields.reserve(count, 8 * count);
    const std::vector<float> model =
        device.read(fields.forward({{count}, slots, at}, false).data.part(0, size_t{8} * count));
    for (uint32_t s = 0; s < count; ++s) {
      float features[8];
      ASSERT_TRUE(looksUp(content, part, &positions[3 * s], features)) << s;
      for (uint32_t f = 0; f < 8; ++f) {
        // The error is half a step of each byte; for a logit, a quarter of that times the value that it weights.
        double maximum = 0.5 * part.ranges[f].scale();
        for (size_t l = 0; l < part.tables.size(); ++l) {
          const ByteRange& fine = part.tables[l].ranges[f];
          const double largest = std::max(std::abs(fine.low), std::abs(fine.high));
          maximum += 0.5 * fine.scale();
          if (varies) maximum += 0.25 * 0.5 * part.ranges[8 + 2 * l + (f > 0 ? 1 : 0)].scale() * largest;
        }
        ASSERT_NEAR(features[f], std::min(model[8 * s + f], 1e9f), 1.01 * maximum + 1e-5) << s << " " << f;
      }
    }
  }
}

// Invariants 7 and 9 of `hash` (docs/invariants.md).
TEST(BakeHash, EvaluatesTheSameSamplesHoweverEmptySpaceIsSkipped) {
  HashConfig config = smallHashConfig();
  config.backgroundBlock = "own";
  for (const uint32_t cells : {32u, 256u}) {
    Baked baked(config, cells);
    MarchCounts all, byCells, byDistances;
    int seen = 0;
    for (uint32_t block = 0; block < 3; ++block) {
      HashContent content = baked.block(block);
      content.step = 1.0f / 400;  // shorter than a cell
      const HashPart& part = content.parts[0];
      const HashFeatures features(content, part);
      const BlockDomain domain = makeBlockDomain(baked.trained.model().space().placement(block));
      const RandomStream random(7, block);
      for (uint64_t ray = 0; ray < 200; ++ray) {
        Triple<double> origin, direction;
        double square = 0;
        for (uint64_t a = 0; a < 3; ++a) {
          origin[a] = domain.centre[a] + 0.9 * domain.scale[a] * (2 * random.uniformDouble(6 * ray + a) - 1);
          direction[a] = 2 * random.uniformDouble(6 * ray + 3 + a) - 1;
          square += direction[a] * direction[a];
        }
        for (double& d : direction) d /= std::sqrt(square);
        double far = domain.contracted ? 1e6 : 1e9;
        for (int a = 0; a < 3 && !domain.contracted; ++a) {
          const double q = (origin[a] - domain.centre[a]) / domain.scale[a], d = direction[a] / domain.scale[a];
          far = std::min(far, std::max((-1 - q) / d, (1 - q) / d));
        }
        const DomainPath path = domainPath(domain, origin, direction, 0.01, far);
        std::vector<uint64_t> sets[3];
        ContentComposite composites[3];
        MarchCounts* const counts[3] = {&all, &byCells, &byDistances};
        for (int mode = 0; mode < 3; ++mode) {
          HashRay one{path, 1, {}, &sets[mode]};
          HashRay* const rays[] = {&one};
          HashMarch{features, content.step, {mode > 0, 0, mode == 2}}.run(rays, *counts[mode]);
          composites[mode] = one.composite;
        }
        ASSERT_EQ(sets[1], sets[0]) << block << " " << ray;
        ASSERT_EQ(sets[2], sets[0]) << block << " " << ray;
        for (int mode = 1; mode < 3; ++mode) {
          EXPECT_EQ(composites[mode].transmittance, composites[0].transmittance);
          for (int k = 0; k < 7; ++k) EXPECT_EQ(composites[mode].values[k], composites[0].values[k]);
        }
        seen += !sets[0].empty();
      }
    }
    EXPECT_GT(seen, 100);
    EXPECT_LT(byCells.steps, all.steps);
    EXPECT_LE(byDistances.steps, byCells.steps);
    if (cells == 256) {  // some occupancy levels are coarser than the grid of distances
      EXPECT_LT(byDistances.steps, byCells.steps);
    }
    EXPECT_EQ(all.samples, byDistances.samples);
  }
}

// Invariant 16 of `hash` (docs/invariants.md).
TEST(BakeHash, StoresAllCornersOfEveryVisibleCell) {
  Baked baked((smallHashConfig()));
  const HashContent content = baked.block(0);
  const HashPart& part = content.parts[0];
  const RandomStream random(11, 1);
  const OccupancyBits& seen = baked.seen[0];
  for (size_t number = 0; number < seen.count(); ++number) {
    if (!seen.at(number)) continue;
    const size_t n = seen.cells, cell[3] = {number % n, number / n % n, number / n / n};
    for (uint64_t i = 0; i < 8; ++i) {  // its corners, and random places
      float place[3], features[8];
      for (uint64_t a = 0; a < 3; ++a) {
        const float within =
            i < 4 ? static_cast<float>(i >> (a % 2) & 1) * 0.99999f : random.uniform(24 * number + 3 * i + a);
        place[a] = std::min((static_cast<float>(cell[a]) + within) / static_cast<float>(n), 1.0f);
      }
      ASSERT_TRUE(looksUp(content, part, place, features)) << number;
    }
    for (size_t level = 1; level < part.occupied.levels.size(); ++level) {
      ASSERT_TRUE(part.occupied.levels[level].at(static_cast<uint32_t>(cell[0] >> level),
                                                 static_cast<uint32_t>(cell[1] >> level),
                                                 static_cast<uint32_t>(cell[2] >> level)));
    }
  }
}

HashLevelModels onlyModel(TrainedHashCube& trained, const fs::path& folder, Device& device) {
  // Baking owns a model of its own, so the trained one is copied.
  return [&trained, folder, &device](uint32_t) {
    auto model = std::make_unique<HashModel>(device, trained.model().config(), trained.model().grid(), false);
    for (uint32_t part = 0; part < trained.trainer->parts(); ++part) {
      const fs::path path = folder / ("part" + std::to_string(part));
      writeFileAtomically(path, trained.trainer->save(part));
      model->restore(part, path, readSafetensors(path));
    }
    return model;
  };
}

HashLevelModels onlyModel(TrainedHashCube& trained, const fs::path& folder) {
  return onlyModel(trained, folder, *trained.device);
}

class BakedScenes : public testing::Test {
 protected:
  BakedScenes() : folder_(fs::temp_directory_path() / ("tessera-bake-hash-" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~BakedScenes() override { fs::remove_all(folder_); }
  const fs::path folder_;
};

double computePsnr(const ImageF& a, const ImageF& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::pow(a.pixels[i] - b.pixels[i], 2);
  return -10 * std::log10(sum / static_cast<double>(a.pixels.size()));
}

TEST_F(BakedScenes, LookAsTheirModelsDo) {
  for (const char* backgroundBlock : {"none", "own", "border"}) {
    for (const char* background : {"random", "learned"}) {
      if (std::string(background) == "learned" && std::string(backgroundBlock) != "border") continue;
      HashConfig config = smallHashConfig();
      config.backgroundBlock = backgroundBlock;
      config.background = background;
      const CubeScene scene;
      TrainedHashCube trained(scene, config, cubeGrid(std::string(backgroundBlock) == "border" ? 1 : 2), 150);
      const fs::path where = folder_ / (std::string(backgroundBlock) + background);
      const BakedScene baked = bakeHash(onlyModel(trained, folder_), 1, scene.capture(), where, {});
      EXPECT_EQ(baked.levels.size(), 1u);
      TileScene opened = openTileScene(where, hashCodec());
      SceneRendererSettings settings;
      settings.threads = 2;
      settings.selection.maximumScreenSpaceError = 0;
      HashRenderer tiles(opened.frame, std::move(opened.tree), std::move(opened.source), settings);
      HashModelRenderer model(trained.model());
      const Capture& capture = scene.capture();
      for (const size_t photo : {size_t{0}, capture.photos.size() / 2}) {
        const Camera& camera = capture.cameras[static_cast<size_t>(capture.photos[photo].camera)];
        const Pose& pose = capture.photos[photo].worldFromCamera;
        const RenderedView a = tiles.render(camera, pose, nullptr), b = model.render(camera, pose, nullptr);
        EXPECT_GT(computePsnr(a.colour, b.colour), 38) << backgroundBlock << " " << background << " " << photo;
        EXPECT_GT(computePsnr(a.opacity, b.opacity), 35) << backgroundBlock << " " << background << " " << photo;
      }
    }
  }
}

TEST_F(BakedScenes, LookTheSameWhenBakedOnVulkan) {
#ifndef TESSERA_HAS_VULKAN
  GTEST_SKIP() << "this build has no Vulkan";
#else
  SKIP_WITHOUT_VULKAN(openForTest());
  const CubeScene scene;
  TrainedHashCube trained(scene, smallHashConfig(), cubeGrid(2), 120);
  const std::unique_ptr<Device> vulkan = makeDevice({"vulkan"});
  const auto drawn = [&](Device& device, const char* name) {
    bakeHash(onlyModel(trained, folder_, device), 1, scene.capture(), folder_ / name, {});
    TileScene opened = openTileScene(folder_ / name, hashCodec());
    SceneRendererSettings settings;
    settings.threads = 2;
    settings.selection.maximumScreenSpaceError = 0;
    HashRenderer tiles(opened.frame, std::move(opened.tree), std::move(opened.source), settings);
    return tiles.render(scene.capture().cameras[0], scene.capture().photos[0].worldFromCamera, nullptr).colour;
  };
  EXPECT_GT(computePsnr(drawn(*vulkan, "vulkan"), drawn(*trained.device, "cpu")), 40);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
}

TEST_F(BakedScenes, AreReproducedByteForByte) {
  const CubeScene scene;
  TrainedHashCube trained(scene, smallHashConfig(), cubeGrid(2), 40);
  const BakedScene once = bakeHash(onlyModel(trained, folder_), 1, scene.capture(), folder_ / "scene", {});
  const BakedScene again = bakeHash(onlyModel(trained, folder_), 1, scene.capture(), folder_ / "scene", {});
  ASSERT_EQ(once.tileset.tiles.size(), again.tileset.tiles.size());
  for (size_t tile = 0; tile < once.tileset.tiles.size(); ++tile) {
    for (size_t i = 0; i < once.tileset.tiles[tile].contents.size(); ++i) {
      EXPECT_EQ(once.tileset.tiles[tile].contents[i].uri, again.tileset.tiles[tile].contents[i].uri);
    }
  }
}

// Entries that no visible sample reads are 0, which compresses well; all others are stored.
TEST(BakeHash, LeavesOutEntriesThatNoVisibleSampleReads) {
  HashConfig config = smallHashConfig();
  config.fineLog2Size = 16;
  Baked baked(config);
  OccupancyBits one(32);
  one.set(one.number(9, 20, 13));
  std::vector<OccupancyBits> seen(baked.seen.size(), one);
  const HashContent content = bakeHashGroup(baked.trained.model(), {0}, seen);
  const HashContent whole = baked.block(0);
  for (size_t l = 0; l < content.parts[0].tables.size(); ++l) {
    const HashTable& table = content.parts[0].tables[l];
    size_t nonZeroEntries = 0;
    for (uint32_t entry = 0; entry < table.entries; ++entry) {
      bool any = false;
      for (size_t f = 0; f < 8; ++f) any |= table.bytes[8 * entry + f] != table.ranges[f].encodeByte(0);
      nonZeroEntries += any;
    }
    const double edge = (table.resolution - 1) / 32.0;
    EXPECT_GT(nonZeroEntries, 0u);
    EXPECT_LE(static_cast<double>(nonZeroEntries), std::pow(std::ceil(edge) + 2, 3));
  }
  const RandomStream random(8, 8);
  for (uint64_t i = 0; i < 200; ++i) {
    const float place[3] = {(9 + random.uniform(3 * i)) / 32, (20 + random.uniform(3 * i + 1)) / 32,
                            (13 + random.uniform(3 * i + 2)) / 32};
    float few[8], all[8];
    ASSERT_TRUE(looksUp(content, content.parts[0], place, few));
    if (!looksUp(whole, whole.parts[0], place, all)) continue;
    for (size_t f = 0; f < 8; ++f) ASSERT_NEAR(few[f], all[f], 0.1) << f;
  }
}

TEST_F(BakedScenes, RejectModelsThatMixByANetworkBeforeVisitingPhotos) {
  HashConfig config = smallHashConfig();
  config.aggregation = "mlp";
  const CubeScene scene;
  TrainedHashCube trained(scene, config, cubeGrid(), 0);
  BakeHashOptions options;
  options.onStep = [](int64_t, int64_t) { ADD_FAILURE() << "visited a photo"; };
  EXPECT_THROW(bakeHash(onlyModel(trained, folder_), 1, scene.capture(), folder_ / "scene", options), Error);
  EXPECT_THROW(bakeHashGroup(trained.model(), {0}, {OccupancyBits(16)}), Error);
}

}  // namespace
}  // namespace tessera
