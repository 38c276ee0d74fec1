#include "representations/volume/vulkan/gpu_volume_content.h"

#include "raymarch/vulkan/part_arguments.h"
#include "shaders/representations/volume/arguments_volume.h"

namespace tessera {

GpuVolumeContent::GpuVolumeContent(const std::shared_ptr<GpuStream>& stream, const VolumeContent& content)
    : featureRange(content.featureRange),
      densityRange(content.densityRange),
      stepsPerTexel(static_cast<float>(content.stepsPerTexel)),
      partCount(static_cast<uint32_t>(content.parts.size())) {
  PackedContent packed;
  std::vector<arguments::VolumePartArguments> all;
  for (const VolumePart& part : content.parts) {
    auto partArguments = placedArguments<arguments::VolumePartArguments>(part);
    partArguments.texels = static_cast<float>(part.planes);
    partArguments.voxels = static_cast<float>(part.voxels);
    for (int a = 0; a < 3; ++a) partArguments.planeWords[a] = packed.add(part.planeBytes[a]);
    partArguments.macroblocks = packed.add(part.macroblocks);
    partArguments.voxelWords = packed.add(part.voxelBytes);
    partArguments.distances = packed.add(part.distances);
    all.push_back(partArguments);
  }
  network = addNetwork(content.network, packed);
  parts = packed.add(all);
  memory = GpuContentMemory(stream, packed.bytes().size());
  const uint64_t base = memory.address();
  for (arguments::VolumePartArguments& part : all) {
    for (uint64_t& plane : part.planeWords) plane += base;
    for (uint64_t* at : {&part.macroblocks, &part.voxelWords, &part.distances}) *at += base;
  }
  packed.replace(parts, all);
  memory.upload(packed);
  for (uint64_t* at : {&parts, &network.layers, &network.weights}) *at += base;
}

}  // namespace tessera
