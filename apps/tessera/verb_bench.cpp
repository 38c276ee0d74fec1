#include "apps/tessera/verbs.h"

namespace tessera {

void addBenchVerb(CLI::App&) {}

}  // namespace tessera
