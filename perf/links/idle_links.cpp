// SPDX-License-Identifier: BSL-1.0
// What links keep of a node's memory after large messages. Each link carries a job of a megabyte and its result, which
// is as large, and then nothing. Prints the node's memory for each link, resident and allocated: after the jobs; when
// the links are idle; and when the C library has returned what is not allocated, as `clesd` has it do. The difference
// of the last two is what the C library keeps, not the links.
//
//   cles_idle_links [LINKS]
//
// Exits with 1 if a link keeps more than 64 KiB in the end.
#include <cles/convert.hpp>
#include <cles/service.hpp>
#include <cles/url.hpp>

#include "perf/support/bare_socket.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/descriptor.hpp"
#include "perf/support/pinning.hpp"
#include "perf/support/process_memory.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <malloc.h>
#include <sys/socket.h>

namespace cles::perf {
namespace {

constexpr std::size_t body_bytes = 1'000'000;
constexpr std::chrono::seconds idle_time{5}; // after which a node has released the buffers of idle links
constexpr double most_kept = 64;             // KiB for each link

void run_node(std::size_t links, const child_process::announce& announce) {
    boost::asio::io_context io{1};
    service_options wanted{.name = "node", .listen = {"tcp://127.0.0.1:0"}};
    wanted.limits.links = wanted.limits.links_per_address = links + 1;
    service node{io, wanted};
    node.on_delegate("job", [](const request& asked) { return json_text{std::string{asked.body()}}; });
    node.on_pull("memory", [] { return memory_now(); });
    node.on_push("return_memory", [] { ::malloc_trim(0); });
    announce(node.endpoints().front());
    io.run();
}

/// One request at a time.
class blocking_link {
  public:
    explicit blocking_link(const url& where) : socket_(connect_to(where)) {}

    std::string ask(std::string line) {
        line.push_back('\n');
        send_all(socket_.get(), std::as_bytes(std::span{line}));
        std::array<char, 65536> some{};
        std::string reply;
        while (!reply.ends_with('\n')) {
            const auto count = checked(::recv(socket_.get(), some.data(), some.size(), 0), "recv");
            if (count == 0) {
                throw std::runtime_error("the node has ended a link");
            }
            reply.append(some.data(), static_cast<std::size_t>(count));
        }
        reply.pop_back();
        return reply;
    }

  private:
    descriptor socket_;
};

int measure(std::size_t count) {
    const auto where = place_ends();
    child_process node{where.server, [count](const child_process::announce& announce) { run_node(count, announce); }};
    const auto at = parse_url(node.announced());
    pin_to(where.client);
    blocking_link control{at};
    const auto memory = [&control] {
        const auto reply = control.ask("PULL self:memory");
        return from_json<process_memory>(reply);
    };
    std::vector<blocking_link> links;
    for (std::size_t i = 0; i < count; ++i) {
        links.emplace_back(at).ask("PULL self:memory");
    }
    const auto before = memory();
    const auto report = [&](const char* when) {
        const auto now = memory();
        const auto per_link = [count](std::uint64_t with, std::uint64_t without) {
            return (static_cast<double>(with) - static_cast<double>(without)) / 1024 / static_cast<double>(count);
        };
        const auto resident = per_link(now.resident, before.resident);
        std::cout << when << ": " << resident << " KiB resident for each link, "
                  << per_link(now.allocated, before.allocated) << " allocated\n";
        return resident;
    };
    const auto body = R"({"x":")" + std::string(body_bytes, 'x') + R"("})";
    for (auto& link : links) {
        if (link.ask("DELEGATE self:job " + body) != body) {
            throw std::runtime_error("a job failed");
        }
    }
    report("after the jobs");
    std::this_thread::sleep_for(idle_time);
    report("when idle");
    control.ask("PUSH self:return_memory");
    return report("without what the C library keeps") <= most_kept ? 0 : 1;
}

} // namespace
} // namespace cles::perf

int main(int count, char** arguments) {
    try {
        const std::size_t links = count > 1 ? std::strtoull(arguments[1], nullptr, 10) : 64;
        if (links == 0 || links > 1'000) { // files that a process may open by default
            std::cerr << "cles_idle_links: 1 to 1000 links\n";
            return 2;
        }
        return cles::perf::measure(links);
    } catch (const std::exception& e) {
        std::cerr << "cles_idle_links: " << e.what() << "\n";
        return 1;
    }
}
