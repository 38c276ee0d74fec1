#include "train/ray_budget.h"

#include "base/error.h"

namespace tessera {

void RayBudget::restore(const fs::path& path, const Safetensors& state) {
  const TensorView& rays = state.require(path, "rays", TensorType::u32);
  if (rays.elements() != 1) throw Error(path.string(), "tensor rays", "is not one number", "train again");
  rays_ = std::clamp(wholeGroups(rays.as<uint32_t>()[0]), group_, max_);
}

}  // namespace tessera
