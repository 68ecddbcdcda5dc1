// SPDX-License-Identifier: BSL-1.0
#include "client/logging.hpp"

#include "client/wire_log.hpp"
#include "output/terminal.hpp"

#include <spdlog/logger.h>
#include <spdlog/sinks/ansicolor_sink.h>

#include <memory>

namespace tool {
namespace {

spdlog::level::level_enum level_of(cles::log_level level) {
    switch (level) {
    case cles::log_level::debug: return spdlog::level::debug;
    case cles::log_level::info: return spdlog::level::info;
    case cles::log_level::warning: return spdlog::level::warn;
    case cles::log_level::error: return spdlog::level::err;
    }
    return spdlog::level::err;
}

cles::log_sink make_log(spdlog::level::level_enum threshold) {
    const auto colours = has_colours(stream::err) ? spdlog::color_mode::always : spdlog::color_mode::never;
    auto sink = std::make_shared<spdlog::sinks::ansicolor_stderr_sink_st>(colours);
    const auto logger = std::make_shared<spdlog::logger>("cles", std::move(sink));
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%-7l%$ %v");
    logger->set_level(threshold);
    logger->flush_on(spdlog::level::debug);
    return [logger](cles::log_level level, std::string_view text) {
        const auto spd_level = level_of(level);
        if (logger->should_log(spd_level)) {
            logger->log(spd_level, spdlog::string_view_t{printable(text)});
        }
    };
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
    return with_lines(make_log(verbosity == 1 ? spdlog::level::info : spdlog::level::debug), verbosity);
}

cles::log_sink make_server_log(int verbosity) {
    return with_lines(make_log(verbosity == 0 ? spdlog::level::info : spdlog::level::debug), verbosity);
}

} // namespace tool
