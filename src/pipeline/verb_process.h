// Verbs of this program as processes of their own, so that their memory is free afterwards.
#pragma once

#include <string>
#include <vector>

#include "pipeline/photo_run.h"

namespace tessera {

// Runs `tessera VERB --device ... ARGUMENTS`. Its messages are in OUT/logs/VERB.log; the last one is shown meanwhile,
// and returned as the summary, and warnings are repeated in the end. An interruption is passed on. Throws
// RunInterrupted if it has ended the verb, and Error if the verb cannot be run or fails.
std::string runVerb(const PhotoRunOptions& options, const std::string& verb, std::vector<std::string> arguments);

}  // namespace tessera
