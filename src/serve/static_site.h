// Folders as a web site: what to answer to a request for a file in one of them. Knows nothing of sockets.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "serve/http_request.h"
#include "serve/site_file.h"

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
  std::shared_ptr<const SiteFile> file;                      // or bytes of this one
  ByteRange bytes;
  bool isGzipped = false;  // or all of it, compressed (compressor.h): then its length is not known yet
  uint64_t length = 0;     // of the body, whether it is sent or not
  bool sendsBody = true;   // false for HEAD
};

// Files alone: no listing of folders, nothing that begins with a dot, nothing outside the folders, by links either. A
// file is opened once, and what is opened is looked at: an answer holds to it whatever happens to its path. Files whose
// name holds a digest of their bytes (tiles/scene_folder.h) may be kept by clients forever; of others they must ask
// whether they have changed.
class StaticSite {
 public:
  // Hosts: what clients may call the server; any where there is none. (Against pages of other sites that have their
  // name resolved to this machine.) Who asks for "/" without a query is sent on to `start`, if there is one. Throws
  // Error where a folder is none, or /proc is not there.
  StaticSite(std::vector<SiteFolder> folders, std::vector<std::string> hosts, std::string start = "");

  SiteAnswer answer(const SiteRequest& request) const;

 private:
  SiteFile::Opening fileAt(const std::string& path) const;

  std::vector<SiteFolder> folders_;
  std::vector<std::string> hosts_;
  std::string start_;
};

}  // namespace tessera
