#include "base/check.h"

#include <cstdio>
#include <cstdlib>

namespace tessera::check_internal {

void fail(const char* file, int line, const char* expression, const std::string& values) {
  std::fprintf(stderr, "%s:%d: CHECK(%s) failed: %s\n", file, line, expression, values.c_str());
  std::abort();
}

}  // namespace tessera::check_internal
