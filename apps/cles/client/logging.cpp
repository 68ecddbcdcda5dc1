// SPDX-License-Identifier: BSL-1.0
#include "client/logging.hpp"

#include "client/wire_log.hpp"
#include "output/log_line.hpp"
#include "output/log_writer.hpp"
#include "output/terminal.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

namespace tool {
namespace {

std::string stamped(cles::log_level level, std::string_view text) {
    static const bool coloured = has_colours(stream::err);
    return log_line(std::chrono::system_clock::now(), level, printable(text), coloured);
}

cles::log_sink with_lines(cles::log_sink log, int verbosity) {
    if (verbosity >= 2) {
        log_wire(log);
    }
    return log;
}

} // namespace

cles::log_sink make_client_log(int verbosity) {
    if (verbosity == 0) {
        return {};
    }
    const auto threshold = verbosity == 1 ? cles::log_level::info : cles::log_level::debug;
    return with_lines(
        [threshold](cles::log_level level, std::string_view text) {
            if (level >= threshold) {
                write_stderr(stamped(level, text));
            }
        },
        verbosity);
}

server_log::server_log(int verbosity)
    : writer_(std::make_shared<log_writer>(
          stream::err, [](std::uint64_t count) { return stamped(cles::log_level::warning, dropped_text(count)); })),
      sink_(with_lines(
          [writer = writer_, threshold = verbosity == 0 ? cles::log_level::info : cles::log_level::debug](
              cles::log_level level, std::string_view text) {
              if (level >= threshold) {
                  writer->write(stamped(level, text));
              }
          },
          verbosity)) {}

server_log::~server_log() { writer_->close(); }

} // namespace tool
