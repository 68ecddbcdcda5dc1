// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_log.hpp"

#include "daemon/log_format.hpp"

#include <spdlog/logger.h>
#include <spdlog/sinks/ansicolor_sink.h>

#include <cstdlib>
#include <utility>

#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr auto text_pattern = "%Y-%m-%dT%H:%M:%S.%e%z %^%-7l%$ %v";
constexpr auto json_pattern = R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})";

spdlog::level::level_enum rank_of(log_level level) {
    switch (level) {
    case log_level::debug: return spdlog::level::debug;
    case log_level::info: return spdlog::level::info;
    case log_level::warning: return spdlog::level::warn;
    case log_level::error: break;
    }
    return spdlog::level::err;
}

spdlog::color_mode colours() {
    const char* none = std::getenv("NO_COLOR");
    const bool wanted = (none == nullptr || *none == '\0') && ::isatty(STDERR_FILENO) == 1;
    return wanted ? spdlog::color_mode::automatic : spdlog::color_mode::never;
}

} // namespace

daemon_log::daemon_log(std::string node, log_config how)
    : node_(std::move(node)), logger_(std::make_shared<spdlog::logger>(
                                  "clesd", std::make_shared<spdlog::sinks::ansicolor_stderr_sink_st>(colours()))),
      format_(how.format) {
    logger_->flush_on(spdlog::level::debug);
    set(how);
}

void daemon_log::set(log_config how) {
    const std::scoped_lock lock{mutex_};
    logger_->set_pattern(how.format == log_format::json ? json_pattern : text_pattern);
    logger_->set_level(rank_of(how.level));
    format_ = how.format;
}

void daemon_log::write(log_level level, const log_entry& entry) const {
    const auto rank = rank_of(level);
    if (logger_->should_log(rank)) {
        const std::scoped_lock lock{mutex_};
        const auto line = format_ == log_format::json ? json_of(node_, entry) : text_of(node_, entry);
        logger_->log(rank, spdlog::string_view_t{line});
    }
}

log_sink daemon_log::sink() const {
    return [this](log_level level, const log_entry& entry) { write(level, entry); };
}

} // namespace cles::runtime
