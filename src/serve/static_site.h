// Folders as a web site: what to answer to a request for a file in one of them. Knows nothing of sockets.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "serve/http_request.h"

namespace tessera {

// Below "/" + name + "/" lies the folder; below "/" where the name is empty.
struct SiteFolder {
  std::string name;
  fs::path folder;
};

struct SiteRequest {
  std::string method = "GET", target = "/";
  std::string host, range, ifRange, ifNoneMatch, acceptEncoding;  // headers, '' where there is none
};

struct SiteAnswer {
  int status = 200;
  std::vector<std::pair<std::string, std::string>> headers;  // but those of the connection
  std::string body;                                          // where it is no file
  std::shared_ptr<const std::string> compressed;             // or this
  fs::path file;                                             // or bytes of this one, if it is not empty
  ByteRange bytes;
  uint64_t length = 0;    // of the body, whether it is sent or not
  bool sendsBody = true;  // false for HEAD
};

// Files alone: no listing of folders, nothing that begins with a dot, nothing outside the folders, by links either.
// Files whose name holds a digest of their bytes (tiles/scene_folder.h) may be kept by clients forever; of others they
// must ask whether they have changed.
class StaticSite {
 public:
  // Hosts: what clients may call the server; any where there is none. (Against pages of other sites that have their
  // name resolved to this machine.) Throws Error where a folder is none.
  StaticSite(std::vector<SiteFolder> folders, std::vector<std::string> hosts);

  SiteAnswer answer(const SiteRequest& request) const;

 private:
  struct Compressed {
    std::string tag;
    std::shared_ptr<const std::string> bytes;
  };
  std::optional<fs::path> fileAt(const std::string& path) const;
  std::shared_ptr<const std::string> compressedOf(const fs::path& file, const std::string& tag) const;

  std::vector<SiteFolder> folders_;
  std::vector<std::string> hosts_;
  mutable std::mutex mutex_;
  mutable std::map<fs::path, Compressed> compressed_;  // a few small files of text
};

}  // namespace tessera
