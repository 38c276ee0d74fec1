// HTTP/1.1 over TCP, asynchronous: a client that stalls costs a socket and small buffers, here and in the system, and
// its turn ends.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "serve/static_site.h"

namespace tessera {

struct HttpServerSettings {
  std::string address = "127.0.0.1";
  uint16_t port = 8080;                          // 0: one that is free
  size_t mostConnections = 2048;                 // beyond, the one that has been silent for longest is closed
  std::chrono::milliseconds requestTime{15000};  // for a whole request to come
  std::chrono::milliseconds idleTime{60000};     // between requests
  std::chrono::milliseconds sendTime{30000};     // for a client to take the next 64 KiB
  std::chrono::milliseconds lingerTime{2000};    // for a client to hear the last answer, while what it sends is read
};

class HttpServer {
 public:
  // Listens. Keeps a reference to the site. Throws Error where the address is none or taken.
  HttpServer(const StaticSite& site, const HttpServerSettings& settings);
  ~HttpServer();

  uint16_t port() const;
  // Serves until `stop` is called (from any thread), or `stopped`, asked now and then, says so.
  void run(const std::function<bool()>& stopped = {});
  void stop();
  size_t connections() const;  // open now

 private:
  class Connection;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
