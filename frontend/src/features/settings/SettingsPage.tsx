import { SegmentedControl, Skeleton, Switch, TextInput, useMantineColorScheme } from "@mantine/core";
import { useSystem } from "../../api/system";
import { speak } from "../../live/speak";
import { ErrorNotice } from "../../ui/ErrorNotice";
import work from "../../ui/Page.module.css";
import { Panel } from "../../ui/Panel";
import { useOperatorName, useSpeechWanted } from "../../ui/usePreferences";
import { useTitle } from "../../ui/useTitle";
import { About } from "./About";
import { Backup } from "./Backup";
import { RemoteAccess } from "./RemoteAccess";
import classes from "./SettingsPage.module.css";

const THEMES = [
  { value: "light", label: "Light" },
  { value: "dark", label: "Dark" },
  { value: "auto", label: "As the system" },
] as const;

/** This browser's choices, and the server it talks to. */
export function SettingsPage() {
  useTitle("Settings");
  const system = useSystem();
  return (
    <>
      <div className={work["head"]}>
        <h1 className={work["title"]}>Settings</h1>
      </div>
      <div className={classes["columns"]}>
        <div className={classes["column"]}>
          <Panel title="This browser">
            <ThisBrowser />
          </Panel>
          {system.data && <About system={system.data} />}
        </div>
        {system.data === undefined ? (
          <div>
            <ErrorNotice error={system.error} />
            {system.isPending && <Skeleton height={320} radius="md" aria-busy="true" />}
          </div>
        ) : (
          <div className={classes["column"]}>
            <RemoteAccess system={system.data} />
            <Backup system={system.data} />
          </div>
        )}
      </div>
    </>
  );
}

function ThisBrowser() {
  const { colorScheme, setColorScheme } = useMantineColorScheme();
  const [name, setName] = useOperatorName();
  const [speech, setSpeech] = useSpeechWanted();
  const canSpeak = "speechSynthesis" in window;
  return (
    <div className={classes["stack"]}>
      <div>
        <p className={classes["label"]} id="appearance">
          Appearance
        </p>
        <SegmentedControl
          aria-labelledby="appearance"
          size="md"
          data={[...THEMES]}
          value={colorScheme}
          onChange={(value) => setColorScheme(value as typeof colorScheme)}
        />
      </div>
      <Switch
        label="Spoken announcements"
        description={
          canSpeak
            ? "“Landed, captured, 0.24 metres.” After a reload, tap the page once: browsers speak only then."
            : "This browser has no voice. What it would say still reaches a screen reader."
        }
        size="md"
        checked={speech}
        disabled={!canSpeak}
        onChange={({ currentTarget: { checked } }) => {
          setSpeech(checked);
          if (checked) speak({ text: "Announcements are on.", urgent: true });
        }}
      />
      <TextInput
        label="Your name"
        description="With it you take control of a vehicle; everybody sees it there."
        value={name}
        maxLength={80}
        autoComplete="name"
        onChange={({ currentTarget: { value } }) => setName(value)}
      />
    </div>
  );
}
