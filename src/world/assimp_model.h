// Reads models of OBJ and FBX by assimp.
#pragma once

#include "world/model_assembler.h"

namespace tessera {

// `path`: of the model's own file. Adds all that it shows to `to`, without animations and skins. Throws Error that
// names `path`. Assimp does not withstand every file: it first reads the model in a copy of this process, with limits.
void readByAssimp(const std::string& path, const ModelFileReader& readFile, ModelAssembler& to,
                  const ModelLimits& limits);

}  // namespace tessera
