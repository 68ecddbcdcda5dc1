// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_log.hpp"

#include <cles/json_writer.hpp>
#include <cles/printable.hpp>

#include <spdlog/logger.h>
#include <spdlog/sinks/ansicolor_sink.h>

#include <cstdlib>
#include <utility>

#include <unistd.h>

namespace cles::runtime {
std::string format_text(std::string_view node, const log_entry& entry) {
    std::string out{node};
    if (!entry.peer.empty()) {
        out.append(" ").append(entry.peer);
    }
    if (entry.request != 0) {
        out.append(" id=").append(std::to_string(entry.request));
    }
    return printable(out.append(": ").append(entry.text));
}

std::string format_json(std::string_view node, const log_entry& entry) {
    std::string out;
    json_writer w{out};
    w.begin_object();
    w.plain_key("node");
    w.value(node);
    if (!entry.peer.empty()) {
        w.plain_key("peer");
        w.value(entry.peer);
    }
    if (entry.request != 0) {
        w.plain_key("id");
        w.value(entry.request);
    }
    if (!entry.trace.empty()) {
        w.plain_key("trace");
        w.value(entry.trace);
    }
    w.plain_key("message");
    w.value(entry.text);
    w.end_object();
    return printable(std::string_view{out}.substr(1, out.size() - 2));
}

namespace {

constexpr auto text_pattern = "%Y-%m-%dT%H:%M:%S.%e%z %^%-7l%$ %v";
constexpr auto json_pattern = R"({"time":"%Y-%m-%dT%H:%M:%S.%e%z","level":"%l",%v})";

spdlog::level::level_enum spdlog_level(log_level level) {
    switch (level) {
    case log_level::debug: return spdlog::level::debug;
    case log_level::info: return spdlog::level::info;
    case log_level::warning: return spdlog::level::warn;
    case log_level::error: break;
    }
    return spdlog::level::err;
}

spdlog::color_mode stderr_color_mode() {
    const char* none = std::getenv("NO_COLOR");
    const bool wanted = (none == nullptr || *none == '\0') && ::isatty(STDERR_FILENO) == 1;
    return wanted ? spdlog::color_mode::automatic : spdlog::color_mode::never;
}

} // namespace

daemon_log::daemon_log(std::string node, log_config how)
    : node_(std::move(node)),
      logger_(std::make_shared<spdlog::logger>(
          "clesd", std::make_shared<spdlog::sinks::ansicolor_stderr_sink_st>(stderr_color_mode()))),
      format_(how.format) {
    logger_->flush_on(spdlog::level::debug);
    set(how);
}

void daemon_log::set(log_config how) {
    const std::scoped_lock lock{mutex_};
    logger_->set_pattern(how.format == log_format::json ? json_pattern : text_pattern);
    logger_->set_level(spdlog_level(how.level));
    format_ = how.format;
}

void daemon_log::write(log_level level, const log_entry& entry) const {
    const auto native = spdlog_level(level);
    if (logger_->should_log(native)) {
        const std::scoped_lock lock{mutex_};
        const auto line = format_ == log_format::json ? format_json(node_, entry) : format_text(node_, entry);
        logger_->log(native, spdlog::string_view_t{line});
    }
}

log_sink daemon_log::sink() const {
    return [this](log_level level, const log_entry& entry) { write(level, entry); };
}

} // namespace cles::runtime
