// Sends an order by vda-5050-lib and follows it: node master.js URL MANUFACTURER SERIAL ORDER. Prints one line of JSON.
const {MasterController} = require("vda-5050-lib");
const clientOptions = require("./client");

const [url, manufacturer, serialNumber, order] = process.argv.slice(2);
const robot = {manufacturer, serialNumber};
const result = {accepted: false, finished: false, nodes: [], errors: []};

function end() {
  console.log(JSON.stringify(result));
  process.exit(result.finished ? 0 : 1);
}

(async () => {
  const master = new MasterController(clientOptions(url), {});
  await master.start();
  // The order is sent when the robot is known to be online.
  master.trackAgvs((agv, state) => {
    if (agv.serialNumber !== serialNumber || state !== "ONLINE" || result.accepted) return;
    result.accepted = true;
    master.assignOrder(robot, JSON.parse(order), {
      onOrderProcessed: (error, byCancelation, active) => {
        if (active) return;
        if (error !== undefined) result.errors.push(JSON.stringify(error));
        result.finished = error === undefined && !byCancelation;
        end();
      },
      onNodeTraversed: (node) => result.nodes.push(node.nodeId),
    }).catch((error) => { result.errors.push(String(error)); end(); });
  });
})();
