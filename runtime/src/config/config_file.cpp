// SPDX-License-Identifier: BSL-1.0
#include "config/config_file.hpp"

#include "config/config_error.hpp"
#include "config/config_limits.hpp"
#include "config/config_node.hpp"

#include <cerrno>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>
#include <vector>

namespace cles::runtime {
namespace {

constexpr std::size_t longest_file = 1U << 20U;

// A list of texts, each of which stands for something; one alone may stand without brackets.
template <class F>
std::vector<std::string> texts(const config_node& from, F to) {
    if (from.is_text()) {
        return {from.as(to)};
    }
    std::vector<std::string> all;
    from.list([&](const config_node& item) { all.push_back(item.as(to)); });
    return all;
}

template <class T>
config_node::reader count_into(T& to, std::uint64_t least, std::uint64_t most) {
    return [&to, least, most](const config_node& v) {
        to = static_cast<T>(v.as([&](const std::string& text) { return to_count(text, least, most); }));
    };
}

config_node::reader switch_into(bool& to) {
    return [&to](const config_node& v) { to = v.as(to_switch); };
}

config_node::reader span_into(std::chrono::microseconds& to) {
    return [&to](const config_node& v) { to = v.as(to_duration); };
}

// A text with commas, or a list.
std::string interfaces_of(const config_node& from) {
    if (from.is_text()) {
        return from.as(to_interfaces);
    }
    std::string all;
    from.list([&](const config_node& item) { all += (all.empty() ? "" : ",") + item.as(to_interfaces); });
    try {
        return to_interfaces(all);
    } catch (const bad_value& wrong) {
        from.refuse(wrong.what());
    }
}

multicast_options multicast_of(const config_node& from) {
    if (from.is_text()) {
        return from.as(to_multicast);
    }
    multicast_options read{.interface = "lo"};
    if (from.is_list()) {
        read.interface = interfaces_of(from);
        return read;
    }
    from.map({{"interface", [&](const config_node& v) { read.interface = interfaces_of(v); }},
              {"group",
               [&](const config_node& v) {
                   read.group = v.as([](const std::string& group) { return to_multicast("lo," + group + ":1").group; });
               }},
              {"port", count_into(read.port, 1, 65535)},
              {"required", switch_into(read.required)}});
    return read;
}

void read_log(const config_node& from, log_config& over) {
    if (from.is_text()) {
        over = from.as([&](const std::string& text) { return to_log(text, over); });
        return;
    }
    from.map({{"level", [&](const config_node& v) { over.level = v.as(to_log_level); }},
              {"format", [&](const config_node& v) { over.format = v.as(to_log_format); }}});
}

plugin_config plugin_of(const config_node& from) {
    const auto to_path = [](const std::string& path) {
        if (path.empty()) {
            throw bad_value("is empty");
        }
        return path;
    };
    plugin_config read;
    if (from.is_text()) {
        read.path = from.as(to_path);
        return read;
    }
    from.map({{"path", [&](const config_node& v) { read.path = v.as(to_path); }},
              {"config", [&](const config_node& v) { read.config = v.json(); }},
              {"required", switch_into(read.required)}});
    if (read.path.empty()) {
        from.refuse("has no 'path'");
    }
    return read;
}

void read_all(const config_node& from, config& over) {
    constexpr std::uint64_t most_workers = 1024;
    constexpr std::uint64_t most_queued = 1'000'000;
    from.map({{"node", [&](const config_node& v) { over.node = v.as(to_node_name); }},
              {"pool", [&](const config_node& v) { over.pool = v.as(to_pool_name); }},
              {"allow_clash", switch_into(over.allow_clash)},
              {"listen", [&](const config_node& v) { over.listen = texts(v, to_url); }},
              {"insecure", switch_into(over.insecure)},
              {"networks", [&](const config_node& v) { over.networks = texts(v, to_network); }},
              {"multicast", [&](const config_node& v) { over.multicast = multicast_of(v); }},
              {"seeds", [&](const config_node& v) { over.seeds = texts(v, to_url); }},
              {"peers",
               [&](const config_node& v) {
                   over.peers.clear();
                   v.names([&](const std::string& name, const config_node& url) { over.peers[name] = url.as(to_url); });
               }},
              {"workers", count_into(over.workers, 1, most_workers)},
              {"queue", count_into(over.queue, 1, most_queued)},
              {"stuck_after", span_into(over.stuck_after)},
              {"replacements", count_into(over.replacements, 0, most_workers)},
              {"drain", span_into(over.drain)},
              {"plugins",
               [&](const config_node& v) {
                   over.plugins.clear();
                   v.list([&](const config_node& item) { over.plugins.push_back(plugin_of(item)); });
               }},
              {"plugin_path",
               [&](const config_node& v) { over.plugin_path = texts(v, [](const std::string& s) { return s; }); }},
              {"log", [&](const config_node& v) { read_log(v, over.log); }},
              {"limits", [&](const config_node& v) { read_limits(v, over.limits); }},
              {"busy_poll", span_into(over.busy_poll)},
              {"real_time", count_into(over.real_time, 0, 99)},
              {"wake_within", [&](const config_node& v) { over.wake_within = v.as(to_wake_bound); }}});
}

// Calls `each(line, number)` for the lines that hold more than blanks and a comment.
template <class F>
void for_lines(const std::string& text, F&& each) {
    constexpr std::string_view byte_order_mark{"\xEF\xBB\xBF"};
    std::istringstream in{text.starts_with(byte_order_mark) ? text.substr(byte_order_mark.size()) : text};
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
        const auto begin = line.find_first_not_of(" \t\r");
        if (begin != std::string::npos && line[begin] != '#') {
            each(line, number);
        }
    }
}

// Directives before and after a document, which the parser passes over in silence, whatever they say.
void check_directives(const std::string& text, const std::string& name) {
    bool outside = true; // of a document
    for_lines(text, [&](const std::string& line, std::size_t number) {
        if (outside && line.starts_with('%')) {
            if (!line.starts_with("%YAML ") && !line.starts_with("%TAG ")) {
                throw config_error(name + ":" + std::to_string(number),
                                   "is no YAML: unknown directive: " + line.substr(0, 40));
            }
            return;
        }
        outside = line.starts_with("...");
    });
}

// A file without settings holds comments, and the marks of a document at most.
void check_empty(const std::string& text, const std::string& name) {
    for_lines(text, [&](const std::string& line, std::size_t number) {
        if (!line.starts_with("---") && !line.starts_with("...") && !line.starts_with('%')) {
            throw config_error(name + ":" + std::to_string(number), "holds no setting: " + line.substr(0, 40));
        }
    });
}

YAML::Node parse(const std::string& text, const std::string& name) {
    try {
        const auto documents = YAML::LoadAll(text);
        if (documents.size() > 1) {
            throw config_error(name, "holds " + std::to_string(documents.size()) + " documents, not one");
        }
        return documents.empty() ? YAML::Node{} : documents.front();
    } catch (const YAML::Exception& wrong) {
        const auto line = wrong.mark.line + 1;
        throw config_error(line > 0 ? name + ":" + std::to_string(line) : name, "is no YAML: " + wrong.msg);
    }
}

} // namespace

void read_config(const std::string& text, const std::string& name, config& over) {
    check_directives(text, name);
    const auto whole = parse(text, name);
    if (whole.IsNull()) {
        check_empty(text, name);
        return;
    }
    read_all({whole, "", name, over.origins}, over);
}

void read_config_file(const std::string& path, config& over) {
    errno = 0;
    std::ifstream in{path, std::ios::binary};
    std::string text(longest_file + 1, '\0');
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (!in && !in.eof()) {
        throw config_error(path, "cannot be read: " + std::generic_category().message(errno));
    }
    text.resize(static_cast<std::size_t>(in.gcount()));
    if (text.size() > longest_file) {
        throw config_error(path, "has more than " + std::to_string(longest_file) + " bytes");
    }
    read_config(text, path, over);
    over.file = path;
}

} // namespace cles::runtime
