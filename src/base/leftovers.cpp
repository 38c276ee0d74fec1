#include "base/leftovers.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <string_view>

namespace tessera {

fs::path partialPlace(const fs::path& place) {
  fs::path partial = place;
  partial += ".partial-" + std::to_string(::getpid());
  return partial;
}

void removeLeftovers(const fs::path& place) {
  const std::string prefix = place.filename().string() + ".partial-";
  std::error_code ignored;
  const fs::path parent = place.has_parent_path() ? place.parent_path() : fs::path(".");
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    int process = 0;
    const char* const end = name.data() + name.size();
    const auto [read, error] = std::from_chars(name.data() + prefix.size(), end, process);
    const std::string_view rest(read, static_cast<size_t>(end - read));
    if (error != std::errc() || process <= 0 || !(rest.empty() || rest == kReplaced || rest == kSpooled)) continue;
    if (::kill(process, 0) == 0 || errno != ESRCH) continue;
    // Of what was being replaced, nothing else may be left.
    if (rest == kReplaced && !fs::exists(place, ignored)) {
      fs::rename(entry.path(), place, ignored);
    } else {
      fs::remove_all(entry.path(), ignored);
    }
  }
}

}  // namespace tessera
