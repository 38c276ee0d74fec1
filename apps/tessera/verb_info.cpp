#include "apps/tessera/verbs.h"

namespace tessera {

void addInfoVerb(CLI::App&) {}

}  // namespace tessera
