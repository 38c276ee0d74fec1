#include "apps/tessera/verbs.h"

namespace tessera {

void addRenderVerb(CLI::App&) {}

}  // namespace tessera
