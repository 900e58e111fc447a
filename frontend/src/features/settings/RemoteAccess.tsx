import { Anchor } from "@mantine/core";
import { useState } from "react";
import { codeOf, type System } from "../../api/system";
import { Panel } from "../../ui/Panel";
import { SelectField } from "../../ui/SelectField";
import classes from "./SettingsPage.module.css";

/** How to open this dashboard on another device, and the security consequences. */
export function RemoteAccess({ system }: { system: System }) {
  return (
    <Panel title="Open on a tablet">
      <div className={classes["stack"]}>
        {system.addresses.length > 0 ? <Reachable system={system} /> : <LocalOnly system={system} />}
      </div>
    </Panel>
  );
}

function Reachable({ system: { addresses, exposes, host, in_container } }: { system: System }) {
  const urls = addresses.map(({ url }) => url);
  const [chosen, setChosen] = useState(urls[0] ?? "");
  return (
    <>
      {addresses.length > 1 && (
        <SelectField
          label="Network"
          value={chosen}
          onChange={setChosen}
          data={addresses.map(({ url, interface: name }) => ({ value: url, label: `${name}: ${url}` }))}
        />
      )}
      <div className={classes["code"]}>
        <img src={codeOf(chosen)} alt={`QR code of ${chosen}`} width={220} height={220} />
        <p className={classes["quiet"]}>
          Scan the code with the tablet’s camera, or enter
          <Anchor href={chosen} className={classes["address"] ?? ""}>
            {chosen}
          </Anchor>
          Both devices must be on the same network. The tablet has read-only access. To change campaigns and fly
          simulations from it, open the link that <code>gainline unlock</code> prints on this computer.
        </p>
      </div>
      {in_container && (
        <p className={classes["quiet"]}>
          Gainline runs in a container, and this is the container’s address. If the tablet cannot reach it, use the
          computer’s address and the published port.
        </p>
      )}
      <p className={classes["warning"]}>
        <strong>The server listens on {host}</strong>, so {exposes}
      </p>
    </>
  );
}

function LocalOnly({ system: { exposes, host, is_exposed } }: { system: System }) {
  if (is_exposed) {
    return (
      <p className={classes["quiet"]}>The server listens on {host}, but this computer is not connected to a network.</p>
    );
  }
  return (
    <>
      <p className={classes["quiet"]}>
        Only this computer can open the dashboard, because the server listens on {host}. To open it on a tablet on the
        same network, stop the server and start it with
      </p>
      <code className={classes["command"]}>gainline serve --host 0.0.0.0</code>
      <p className={classes["quiet"]}>(from a checkout: ./dev up --host 0.0.0.0). Its address then appears here.</p>
      <p className={classes["warning"]}>
        <strong>Security:</strong> {exposes}
      </p>
    </>
  );
}
