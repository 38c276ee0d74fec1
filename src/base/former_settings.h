// Former names of settings, so that the error for a file or command with an old name can give the current one. Old
// names are never accepted.
#pragma once

#include <string_view>

namespace tessera {

// Returns the current name of the setting formerly called `key`; empty where no setting ever had that name.
std::string_view currentSettingName(std::string_view key);

}  // namespace tessera
