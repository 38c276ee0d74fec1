// Draws `mesh` contents on a GPU.
#pragma once

#include "render/vulkan/gpu_drawer.h"

namespace tessera {

// Which processor infers the maps of contents that have an encoder in their place.
enum class MeshInference {
  automatic,  // the GPU, except where a driver for the CPU stands for it
  cpu,        // in the threads that read contents
  gpu,
};

struct GpuMeshSettings {
  // How frames of a sequence are drawn, where the image need not be exact (DrawSettings::exact).
  bool jitters = true;  // frames at rest show different places within the pixels, so that edges are smooth
  bool blends = true;   // frames are blended with those before them
  // Every fragment is decoded when it is drawn, as in the paper, instead of once per pixel what is visible in it.
  bool decodesFragments = false;
  // The number of fragments for which exact images have memory; 0: an eighth of the GPU's memory. Images with more are
  // drawn in several strips.
  uint32_t listedFragments = 0;
  MeshInference inference = MeshInference::automatic;
};

std::unique_ptr<GpuDrawer> makeGpuMeshDrawer(const std::shared_ptr<GpuStream>& stream);
std::unique_ptr<GpuDrawer> makeGpuMeshDrawer(const std::shared_ptr<GpuStream>& stream, const GpuMeshSettings& settings);

}  // namespace tessera
