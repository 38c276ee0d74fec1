#include "photogrammetry/look_alikes.h"

#include <algorithm>
#include <map>
#include <string>

namespace tessera {

LookAlikes parseLookAlikes(std::string_view text, const PhotoList& list) {
  std::map<std::string_view, int> photos;
  for (size_t i = 0; i < list.photos.size(); ++i) photos[list.photos[i].safeName] = static_cast<int>(i);
  const auto find = [&](std::string_view line, std::string_view before, char after) {
    const size_t begin = line.find(before);
    if (begin == line.npos) return -1;
    const std::string_view rest = line.substr(begin + before.size());
    const auto photo = photos.find(rest.substr(0, rest.find(after)));
    return photo == photos.end() ? -1 : photo->second;
  };
  LookAlikes lookAlikes(list.photos.size());
  int query = -1;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.starts_with("Querying for image ")) {
      query = find(line, "Querying for image ", ' ');
    } else if (const int other = find(line, "image_name=", ','); query >= 0 && other >= 0 && other != query) {
      lookAlikes[static_cast<size_t>(query)].push_back(other);
    }
  }
  return lookAlikes;
}

}  // namespace tessera
