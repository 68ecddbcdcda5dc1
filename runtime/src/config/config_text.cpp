// SPDX-License-Identifier: BSL-1.0
#include "config/config_text.hpp"

#include <cles/json_writer.hpp>

#include "config/config_limits.hpp"
#include "config/config_values.hpp"

#include <algorithm>
#include <string_view>

namespace cles::runtime {
namespace {

// JSON's quotes are YAML's.
std::string in_quotes(std::string_view text) {
    std::string out;
    json_writer w{out};
    w.value(text);
    return out;
}

class yaml_lines {
  public:
    explicit yaml_lines(const config& whole) : whole_(whole) {}

    void line(const std::string& key, const std::string& value) {
        const auto origin = whole_.origins.find(key);
        text_ += key + ": " + value + (origin == whole_.origins.end() ? "" : "  # " + origin->second) + "\n";
    }
    void list(const std::string& key, const std::vector<std::string>& items) {
        std::string all;
        for (const auto& item : items) {
            all += (all.empty() ? "" : ", ") + in_quotes(item);
        }
        line(key, "[" + all + "]");
    }
    void raw(const std::string& lines) { text_ += lines; }
    [[nodiscard]] std::string take() { return std::move(text_); }

  private:
    const config& whole_;
    std::string text_;
};

std::string text_of(const multicast_options& where) {
    return where.is_on() ? "{interface: " + in_quotes(where.interface) + ", group: " + where.group +
                               ", port: " + std::to_string(where.port) +
                               ", required: " + (where.required ? "true" : "false") + "}"
                         : "off";
}

std::string text_of(const std::map<std::string, std::string>& peers) {
    std::string all;
    for (const auto& [name, url] : peers) {
        all += (all.empty() ? "" : ", ") + in_quotes(name) + ": " + in_quotes(url);
    }
    return "{" + all + "}";
}

std::string text_of(const std::vector<plugin_config>& plugins) {
    std::string all;
    for (const auto& p : plugins) {
        all += "  - path: " + in_quotes(p.path) + "\n    config: " + p.config +
               "\n    required: " + (p.required ? "true" : "false") + "\n";
    }
    return all.empty() ? "plugins: []\n" : "plugins:\n" + all;
}

} // namespace

std::string to_yaml(const config& whole) {
    yaml_lines out{whole};
    out.raw(whole.file.empty() ? "# no configuration file\n" : "# " + whole.file + "\n");
    out.line("node", in_quotes(whole.node));
    out.line("pool", in_quotes(whole.pool));
    out.line("allow_clash", whole.allow_clash ? "true" : "false");
    out.list("listen", whole.listen);
    out.line("insecure", whole.insecure ? "true" : "false");
    out.list("networks", whole.networks);
    out.line("multicast", text_of(whole.multicast));
    out.list("seeds", whole.seeds);
    out.line("peers", text_of(whole.peers));
    out.line("workers", std::to_string(whole.workers));
    out.line("queue", std::to_string(whole.queue));
    out.line("stuck_after", to_string(whole.stuck_after));
    out.line("replacements", std::to_string(whole.replacements));
    out.line("drain", to_string(whole.drain));
    out.list("plugin_path", whole.plugin_path);
    out.raw(text_of(whole.plugins));
    out.line("log", "{level: " + std::string{to_string(whole.log.level)} +
                        ", format: " + std::string{to_string(whole.log.format)} + "}");
    out.line("busy_poll", to_string(whole.busy_poll));
    out.line("real_time", std::to_string(whole.real_time));
    out.line("wake_within", wake_bound_text(whole.wake_within));
    out.raw("limits:\n" + limits_text(whole.limits, "  "));
    return out.take();
}

} // namespace cles::runtime
