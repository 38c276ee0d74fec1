// merge_blocks JOINT OUT APART...: writes a `volume` model whose block k is that of the k-th APART, a model of this one
// block and a background block of its own; the background block is JOINT's. It shows the result of training blocks
// independently of each other; see consistency.sh. Exposures, which belong to photos, are left out.
#include <fmt/format.h>

#include <cstdio>

#include "base/error.h"
#include "representations/volume/train/train_volume.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

// Throws Error unless `apart` is cell `cell` of the joint model and has the same settings, except for the numbers of
// rays and points of a step: local coordinates must have the same meaning.
void requireCell(const fs::path& folder, VolumeModel& apart, VolumeModel& joint, int cell) {
  const auto refuse = [&](const char* file, const std::string& why) {
    throw Error((folder / file).string(), "", why, "train it with --grid and the settings of the joint model");
  };
  const BlockGrid &is = apart.grid(), &requested = joint.grid();
  const double tolerance = 1e-9 * requested.edge;
  const Vec2d centre = requested.centre(cell);
  const Vec3d off = is.originInWorld - requested.inWorld({centre.x(), centre.y(), 0});
  if (is.cells() != 1 || !(off.norm() <= tolerance) || is.gridFromWorld != requested.gridFromWorld ||
      is.edge != requested.edge || is.bottom != requested.bottom || is.top != requested.top) {
    refuse("blocks.json", "is not block " + std::to_string(cell) + " alone");
  }
  VolumeConfig has = apart.config(), wants = joint.config();
  has.firstRays = wants.firstRays;
  has.maxRays = wants.maxRays;
  has.texelsPerStep = wants.texelsPerStep;
  has.sparsityPoints = wants.sparsityPoints;
  has.blocksOnly = wants.blocksOnly;
  if (configToToml(has.fields()) != configToToml(wants.fields())) {
    refuse("config.toml", "has other settings than the joint model");
  }
}

void merge(const fs::path& jointFolder, const fs::path& out, const std::vector<fs::path>& apartFolders) {
  const std::unique_ptr<Device> device = makeDevice({});
  const std::unique_ptr<VolumeModel> model = loadVolumeModel(*device, jointFolder);
  if (apartFolders.size() != model->space().cells()) {
    throw Error(jointFolder.string(), "blocks.json", fmt::format("has {} blocks", model->space().cells()),
                "name one model for each");
  }
  const auto copy = [&](Slice<float> to, Slice<const float> from) {
    device->write(to, std::span<const float>(device->read(from)));
  };
  for (uint32_t block = 0; block < apartFolders.size(); ++block) {
    const std::unique_ptr<VolumeModel> apart = loadVolumeModel(*device, apartFolders[block]);
    requireCell(apartFolders[block], *apart, *model, static_cast<int>(block));
    for (const auto fields : {&VolumeModel::attributes, &VolumeModel::proposals}) {
      copy(((*model).*fields)().table(block).values.all(), ((*apart).*fields)().table(0).values.all());
      copy(((*model).*fields)().network(block).values.all(), ((*apart).*fields)().network(0).values.all());
    }
    constexpr size_t kNetwork = DeferredNetwork::kParameters;
    copy(model->deferred().values.part(block * kNetwork, kNetwork), apart->deferred().values.part(0, kNetwork));
  }
  const ModelFolder from(jointFolder), to(out);
  const ModelManifest manifest = requireManifest(from, "volume");
  writeFileAtomically(to.configPath(), readTextFile(from.configPath()));
  to.writePlacement(from.readPlacement(), manifest.method);
  to.commit(manifest, model->space().blocks(), [&](uint32_t block) {
    TensorSet tensors;
    model->save(block, tensors, false);
    return tensors.encode({{"block", std::to_string(block)}});
  });
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "merge_blocks JOINT OUT APART...\n");
    return 2;
  }
  try {
    tessera::merge(argv[1], argv[2], {argv + 3, argv + argc});
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "merge_blocks: %s\n", error.what());
    return 1;
  }
}
