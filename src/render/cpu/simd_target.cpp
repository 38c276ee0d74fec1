#include "render/cpu/simd_target.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/cpu/simd_target.cpp"
#include <hwy/foreach_target.h>
// must follow foreach_target.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::HWY_NAMESPACE {

const char* targetName() {
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace tessera::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

HWY_EXPORT(targetName);

const char* renderSimdTarget() {
  return HWY_DYNAMIC_DISPATCH(targetName)();
}

}  // namespace tessera
#endif
