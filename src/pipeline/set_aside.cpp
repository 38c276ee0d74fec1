#include "pipeline/set_aside.h"

#include "base/error.h"
#include "base/log.h"

namespace tessera {

void setAside(const fs::path& folder) {
  std::error_code status;
  if (!fs::exists(folder, status)) return;
  const fs::path first = fs::path(folder) += ".earlier";
  fs::path earlier = first;
  for (int i = 2; fs::exists(earlier, status); ++i) earlier = fs::path(first) += "-" + std::to_string(i);
  fs::rename(folder, earlier, status);
  if (status) throw Error(folder.string(), "", "cannot be renamed: " + status.message(), "check the disk");
  inform("{} is kept as {}", folder.string(), earlier.string());
}

}  // namespace tessera
