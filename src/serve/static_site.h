// Serves folders as a web site: maps a request to an answer. It is independent of sockets.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "serve/http_request.h"
#include "serve/site_file.h"

namespace tessera {

// A folder that is served below "/" + name + "/", or below "/" if the name is empty.
struct SiteFolder {
  std::string name;
  fs::path folder;
};

struct SiteRequest {
  std::string method = "GET", target = "/";
  std::string host, range, ifRange, ifNoneMatch, acceptEncoding;  // headers; empty if absent
};

struct SiteAnswer {
  int status = 200;
  std::vector<std::pair<std::string, std::string>> headers;  // without those of the connection
  std::string body;                                          // if there is no file
  std::shared_ptr<const SiteFile> file;                      // else the body is `bytes` of this file
  ByteRange bytes;
  bool isGzipped = false;  // the body is the whole file, compressed (compressor.h); its length is not known yet
  uint64_t length = 0;     // of the body, even if it is not sent
  bool sendsBody = true;   // false for HEAD
};

// Serves files only: it lists no folders, and serves nothing whose name begins with a dot and nothing outside the
// folders, not even through links. A file is opened once and then examined, so that an answer keeps referring to the
// same file whatever happens to its path. Clients may cache files whose name contains a digest of their bytes
// (tiles/scene_folder.h) forever; they must revalidate others.
class StaticSite {
 public:
  // `hosts`: the host names under which clients may address the server; any name if it is empty. (This prevents DNS
  // rebinding by pages of other sites.) Requests for "/" without a query are redirected to `start`, if it is not empty.
  // Throws Error if a folder does not exist or /proc is not mounted.
  StaticSite(std::vector<SiteFolder> folders, std::vector<std::string> hosts, std::string start = "");

  SiteAnswer answer(const SiteRequest& request) const;

 private:
  const SiteFolder* findFolder(const std::string& path) const;  // null: none is served there

  std::vector<SiteFolder> folders_;
  std::vector<std::string> hosts_;
  std::string start_;
};

}  // namespace tessera
