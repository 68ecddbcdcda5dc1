// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon_log.hpp"

#include <cles/json_writer.hpp>
#include <cles/printable.hpp>

#include "output/log_line.hpp"
#include "output/terminal.hpp"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <utility>

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

struct daemon_log::style {
    style(std::string of, log_config how) : node(std::move(of)), level(how.level), format(how.format) {}

    [[nodiscard]] std::string line(log_level of, const log_entry& entry) const {
        const auto now = std::chrono::system_clock::now();
        return format == log_format::json ? tool::json_log_line(now, of, format_json(node, entry))
                                          : tool::log_line(now, of, format_text(node, entry), coloured);
    }

    const std::string node;
    const bool coloured = tool::has_colours(tool::stream::err);
    std::atomic<log_level> level;
    std::atomic<log_format> format;
};

daemon_log::daemon_log(std::string node, log_config how)
    : style_(std::make_shared<style>(std::move(node), how)),
      writer_(tool::stream::err, [style = style_](std::uint64_t count) {
          return style->line(log_level::warning, tool::dropped_text(count));
      }) {}

void daemon_log::set(log_config how) {
    style_->format = how.format;
    style_->level = how.level;
}

void daemon_log::write(log_level level, const log_entry& entry) {
    if (level >= style_->level) {
        writer_.write(style_->line(level, entry));
    }
}

log_sink daemon_log::sink() {
    return [this](log_level level, const log_entry& entry) { write(level, entry); };
}

} // namespace cles::runtime
