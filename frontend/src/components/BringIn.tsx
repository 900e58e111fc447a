import { Button, FileButton } from "@mantine/core";
import { useNavigate } from "react-router";
import { useBringIn } from "../api/files";
import { Trouble } from "./Trouble";

/** A campaign from another installation, as its bundle. */
export function BringIn() {
  const bringing = useBringIn();
  const navigate = useNavigate();
  return (
    <div>
      <FileButton
        accept=".zip"
        onChange={(file) =>
          file && bringing.mutate(file, { onSuccess: (campaign) => void navigate(`/campaigns/${campaign.id}`) })
        }
      >
        {(props) => (
          <Button {...props} variant="default" loading={bringing.isPending}>
            Bring in a bundle
          </Button>
        )}
      </FileButton>
      <Trouble error={bringing.error} />
    </div>
  );
}
