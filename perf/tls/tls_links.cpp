// SPDX-License-Identifier: BSL-1.0
// What many links of TLS cost a node: the time to open them, and its memory for each. First the members open them to
// the node, then the node opens them to the members. Each link carries a PULL. Node and members are two processes.
//
//   cles_tls_links [LINKS]
//
// Fails if a link takes more than 64 KiB of the node's resident memory.
#include <cles/convert_containers.hpp>
#include <cles/link.hpp>
#include <cles/security.hpp>
#include <cles/service.hpp>

#include "perf/support/child_process.hpp"
#include "perf/support/descriptor.hpp"
#include "perf/support/pinning.hpp"
#include "perf/support/process_memory.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/fleet/key_directory.hpp"
#include "support/temporary_folder.hpp"
#include "tls/tls_transport.hpp"

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sys/resource.h>

namespace cles::perf {
namespace {

using steady = std::chrono::steady_clock;

constexpr std::size_t opened_at_once = 32;
constexpr std::chrono::minutes patience{2};
constexpr double most_resident = 64;         // KiB for each link
constexpr std::chrono::seconds idle_time{5}; // after which a node has released the buffers of idle links

double seconds_since(steady::time_point begun) { return std::chrono::duration<double>(steady::now() - begun).count(); }

/// A fleet of the node and its members, with a folder for the files of the node.
class fleet_folder {
  public:
    explicit fleet_folder(std::size_t members) {
        const auto directory = security::key_directory::create(node());
        authority_.add(directory.create_key("node").public_part());
        std::vector<security::public_identity> all;
        for (std::size_t i = 0; i < members; ++i) {
            keys_.push_back(security::signing_key::generate());
            all.push_back({name_of(i), keys_.back().public_part()});
        }
        authority_.add(all);
        directory.store_roster(authority_.newest());
    }
    fleet_folder(const fleet_folder&) = delete;
    fleet_folder& operator=(const fleet_folder&) = delete;

    static std::string name_of(std::size_t member) { return "m" + std::to_string(member); }
    [[nodiscard]] std::string node() const { return (folder_ / "node").string(); }
    /// The transports of all members. Call it once.
    std::vector<std::unique_ptr<link_transport>> transports() {
        std::vector<std::unique_ptr<link_transport>> made;
        for (std::size_t i = 0; i < keys_.size(); ++i) {
            made.push_back(tls::make_tls_transport(
                {.fleet = std::make_shared<security::fleet>(name_of(i), std::move(keys_[i]), authority_.share()),
                 .epoch = "00000001"}));
        }
        return made;
    }

  private:
    test::temporary_folder folder_{"cles-tls-links"};
    security::fleet_authority authority_ = security::fleet_authority::found(security::signing_key::generate());
    std::vector<security::signing_key> keys_;
};

/// The node: serves `speed` and `memory`, and with `ask` pulls `speed` from all members at these addresses.
class node_end {
  public:
    node_end(const fleet_folder& of, std::size_t links, const child_process::announce& announce)
        : service_(io_, options(of, links)) {
        service_.on_pull("speed", [] { return 7; });
        service_.on_pull("memory", [] { return memory_now(); });
        service_.on_push("ask", [this](const std::vector<std::string>& urls) {
            urls_ = urls;
            for (std::size_t i = 0; i < opened_at_once; ++i) {
                ask_next();
            }
        });
        service_.on_pull("answered", [this] { return answered_; });
        announce(service_.endpoints().front());
        io_.run();
    }

  private:
    static service_options options(const fleet_folder& of, std::size_t links) {
        service_options made{.name = "node", .listen = {"tls://127.0.0.1:0"}, .security = secured(of.node())};
        made.limits.links = made.limits.links_per_address = links + 1;
        return made;
    }
    void ask_next() {
        if (asked_ == urls_.size()) {
            return;
        }
        const auto member = asked_++;
        const auto name = fleet_folder::name_of(member);
        service_.set_peer(name, urls_[member]);
        service_.async_request("PULL " + name + ":speed", [this](boost::system::error_code code, const json_text&) {
            if (code) {
                throw std::runtime_error("a PULL by the node failed: " + code.message());
            }
            ++answered_;
            ask_next();
        });
    }

    boost::asio::io_context io_{1};
    service service_;
    std::vector<std::string> urls_;
    std::size_t asked_ = 0;
    std::uint64_t answered_ = 0;
};

/// A link of a member: answers PULL with 7, and takes the answers to its own.
class member_link final : public link_events, public std::enable_shared_from_this<member_link> {
  public:
    explicit member_link(link_ptr link) : link_(std::move(link)) {}
    void start() { link_->start(shared_from_this()); }
    void request(std::string_view line, std::function<void(std::string)> done) {
        done_ = std::move(done);
        link_->output().append(line);
        link_->flush();
    }

    void on_line(std::string_view line) override {
        if (line.starts_with("PULL ")) {
            const auto id = line.substr(line.find(" id=") + 1);
            link_->output().append(id.substr(0, id.find(' '))).append(R"( {"value":7})").append("\n");
        } else if (line.starts_with("id=1 ")) {
            std::exchange(done_, nullptr)(std::string{line.substr(5)});
        }
    }
    void on_batch() override { link_->flush(); }
    void on_overlong(std::string_view) override {}
    void on_end() override {}
    void on_lost(boost::system::error_code why) override {
        throw std::runtime_error("a link was lost: " + why.message());
    }
    void on_writable() override {}

  private:
    link_ptr link_;
    std::function<void(std::string)> done_;
};

class members_end {
  public:
    using transports = std::vector<std::unique_ptr<link_transport>>;

    /// The first of the members controls the node.
    members_end(const transports& of, std::string node)
        : transports_(of), links_(of.size() - 1), node_(std::move(node)) {
        bounds_.line = 16U << 20U;
        open(0, [](std::string) {});
        run_until([this] { return answered_ == 1; });
        control_ = opened_.front();
    }

    /// All members but the first open a link and pull. Returns how long it took.
    double pull_all() {
        const auto begun = steady::now();
        std::size_t next = 1;
        std::function<void(std::string)> more = [&](const std::string& reply) {
            if (!reply.empty() && reply != R"({"value":7})") {
                throw std::runtime_error("a PULL failed: " + reply);
            }
            if (next <= links_) {
                open(next++, more);
            }
        };
        for (std::size_t i = 0; i < opened_at_once; ++i) {
            more({});
        }
        run_until([&] { return answered_ == links_ + 1; });
        return seconds_since(begun);
    }
    /// The node does so.
    double be_pulled() {
        std::string body;
        for (std::size_t i = 0; i < links_; ++i) {
            acceptors_.push_back(transports_[i]->listen(io_.get_executor(), parse_url("tls://127.0.0.1:0"), bounds_));
            acceptors_.back()->start([this](link_ptr made) { keep(std::move(made)); });
            body.append(body.empty() ? "[\"" : ",\"").append(to_string(acceptors_.back()->local())).append("\"");
        }
        const auto begun = steady::now();
        ask("PUSH self:ask id=1 " + body + "]");
        while (ask("PULL self:answered id=1") != "{\"value\":" + std::to_string(links_) + "}") {
            io_.run_for(std::chrono::milliseconds{20});
        }
        return seconds_since(begun);
    }
    process_memory memory() {
        const auto text = ask("PULL self:memory id=1");
        return from_json<process_memory>(text);
    }
    void stay_idle() { io_.run_for(idle_time); }

  private:
    void open(std::size_t member, std::function<void(std::string)> then) {
        transports_[member]->dial_node(
            io_.get_executor(), parse_url(node_), "node", bounds_,
            [this, then = std::move(then)](boost::system::error_code code, link_ptr made) {
                if (code) {
                    throw std::runtime_error("cannot open a link: " + code.message());
                }
                keep(std::move(made)).request("PULL self:speed id=1\n", [this, then](std::string reply) {
                    ++answered_;
                    then(std::move(reply));
                });
            });
    }
    member_link& keep(link_ptr made) {
        opened_.push_back(std::make_shared<member_link>(std::move(made)));
        opened_.back()->start();
        return *opened_.back();
    }
    std::string ask(const std::string& request) {
        std::string found;
        control_->request(request + "\n", [&](std::string reply) { found = std::move(reply); });
        run_until([&] { return !found.empty(); });
        return found;
    }
    template <class Condition>
    void run_until(Condition&& holds) {
        const auto end = steady::now() + patience;
        while (!holds()) {
            if (steady::now() > end) {
                throw std::runtime_error("it takes too long");
            }
            io_.run_one_for(std::chrono::seconds{1});
        }
    }

    boost::asio::io_context io_{1};
    limits bounds_;
    const transports& transports_;
    std::size_t links_;
    std::string node_;
    std::vector<std::unique_ptr<acceptor>> acceptors_;
    std::vector<std::shared_ptr<member_link>> opened_;
    std::shared_ptr<member_link> control_;
    std::size_t answered_ = 0;
};

bool report(const char* what, std::size_t links, double took, const process_memory& before, const process_memory& after,
            const process_memory& idle) {
    const auto per_link = [&](std::uint64_t with, std::uint64_t without) {
        return (static_cast<double>(with) - static_cast<double>(without)) / 1024 / static_cast<double>(links);
    };
    const auto resident = per_link(after.resident, before.resident);
    std::cout << links << " links " << what << " in " << took
              << " s, each with a PULL; KiB of the node for each: " << resident << " resident, "
              << per_link(after.allocated, before.allocated) << " allocated; when idle "
              << per_link(idle.resident, before.resident) << ", " << per_link(idle.allocated, before.allocated) << "\n";
    return resident <= most_resident;
}

/// False if the system does not permit so many files.
bool permit_files(std::size_t wanted) {
    rlimit files{};
    checked(::getrlimit(RLIMIT_NOFILE, &files), "getrlimit");
    if (files.rlim_max < wanted) {
        return false;
    }
    files.rlim_cur = std::max<rlim_t>(files.rlim_cur, wanted);
    checked(::setrlimit(RLIMIT_NOFILE, &files), "setrlimit");
    return true;
}

bool measure(std::size_t links) {
    fleet_folder of{links + 1};
    const auto where = place_ends();
    const auto run_node = [&](const child_process::announce& announce) { const node_end end{of, links, announce}; };
    child_process opened{where.server, run_node};
    child_process opening{where.server, run_node};
    const auto transports = of.transports();
    pin_to(where.client);
    bool good = true;
    for (auto* node : {&opened, &opening}) {
        members_end members{transports, node->announced()};
        const auto before = members.memory();
        const auto took = node == &opened ? members.pull_all() : members.be_pulled();
        const auto after = members.memory();
        members.stay_idle();
        const auto idle = members.memory();
        good = report(node == &opened ? "by the members" : "by the node", links, took, before, after, idle) && good;
    }
    return good;
}

} // namespace
} // namespace cles::perf

int main(int count, char** arguments) {
    try {
        const std::size_t links = count > 1 ? std::strtoull(arguments[1], nullptr, 10) : 1'000;
        if (links == 0 || links > 4'000) { // with the two ends, the members of a roster
            std::cerr << "cles_tls_links: 1 to 4000 links\n";
            return 2;
        }
        if (!cles::perf::permit_files(3 * links + 100)) {
            std::cout << "skipped: the system does not permit so many open files\n";
            return 77;
        }
        return cles::perf::measure(links) ? 0 : 1;
    } catch (const std::exception& e) {
        std::cerr << "cles_tls_links: " << e.what() << "\n";
        return 1;
    }
}
