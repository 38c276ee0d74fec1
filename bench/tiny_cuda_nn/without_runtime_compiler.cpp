// tiny-cuda-nn at 6ee3546 without its runtime compiler lacks this member, which its kernels refer to but never call then.
#include <tiny-cuda-nn/rtc_kernel.h>

namespace tcnn {

void CudaRtcKernel::set(CUfunction_attribute, int) {}

}  // namespace tcnn
