// The virtual AGV of vda-5050-lib at the node "start": node virtual_agv.js URL MANUFACTURER SERIAL. Ends with its input.
const {AgvController, VirtualAgvAdapter} = require("vda-5050-lib");
const clientOptions = require("./client");

const [url, manufacturer, serialNumber] = process.argv.slice(2);

(async () => {
  const controller = {agvAdapterType: VirtualAgvAdapter, publishStateInterval: 500};
  const adapter = {initialPosition: {mapId: "yard", x: 1.0, y: 2.0, theta: 0.0, lastNodeId: "start"}, vehicleSpeed: 5.0};
  const agv = new AgvController({manufacturer, serialNumber}, clientOptions(url), controller, adapter);
  await agv.start();
  console.log("ready");
  process.stdin.on("end", () => process.exit(0)).resume();
})();
