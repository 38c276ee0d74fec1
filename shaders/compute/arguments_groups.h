// Arguments of the kernel that counts workgroups for rows that the device counts; see compute/vulkan/counted_groups.h.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_GROUPS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_GROUPS_H

#include "arguments.h"

TESSERA_BEGIN_ARGUMENTS

struct CountGroupsArguments {
  CountArguments rows;
  UintPointer groups;  // [3]: x, y, z
  uint elements;       // per row
  uint perGroup;       // elements per group
  uint maximum;        // along x
  uint y;
};
TESSERA_SIZE(CountGroupsArguments, 48);

TESSERA_END_ARGUMENTS
#endif
