import { Anchor, Stack } from "@mantine/core";
import { useState } from "react";
import { codeOf, type System } from "../../api/system";
import { Note } from "../../ui/Note";
import { Panel } from "../../ui/Panel";
import { SelectField } from "../../ui/SelectField";
import classes from "./SettingsPage.module.css";

/** How to open this dashboard on another device, and the security consequences. */
export function RemoteAccess({ system }: { system: System }) {
  return (
    <Panel title="Open on a tablet">
      <Stack gap={18}>
        {system.addresses.length > 0 ? <Reachable system={system} /> : <LocalOnly system={system} />}
      </Stack>
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
        <Note>
          Scan the code with the tablet’s camera, or enter
          <Anchor href={chosen} className={classes["address"] ?? ""}>
            {chosen}
          </Anchor>
          Both devices must be on the same network. The tablet has read-only access. To change campaigns and fly
          simulations from it, open the link that <code>gainline unlock</code> prints on this computer.
        </Note>
      </div>
      {in_container && (
        <Note>
          Gainline runs in a container, and this is the container’s address. If the tablet cannot reach it, use the
          computer’s address and the published port.
        </Note>
      )}
      <p className={classes["warning"]}>
        <strong>The server listens on {host}</strong>, so {exposes}
      </p>
    </>
  );
}

function LocalOnly({ system: { exposes, host, is_exposed } }: { system: System }) {
  if (is_exposed) {
    return <Note>The server listens on {host}, but this computer is not connected to a network.</Note>;
  }
  return (
    <>
      <Note>
        Only this computer can open the dashboard, because the server listens on {host}. To open it on a tablet on the
        same network, stop the server and start it with
      </Note>
      <code className={classes["command"]}>gainline serve --host 0.0.0.0</code>
      <Note>(from a checkout: ./dev up --host 0.0.0.0). Its address then appears here.</Note>
      <p className={classes["warning"]}>
        <strong>Security:</strong> {exposes}
      </p>
    </>
  );
}
